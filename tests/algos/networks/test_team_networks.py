"""What the agents of a team share: parameters, and a critic that reads all observations."""

import pytest
import torch
from fake_env import FakeEnv
from torchrl.envs import ExplorationType, set_exploration_type
from training import SMALL, rewards_until

from veca_marl.algos.networks.multisense import Critic, MultisenseCfg, Parameters


def sized(**options):
    return MultisenseCfg(**{**vars(SMALL), **options})


def seen(agents, worlds=4):
    state = FakeEnv(worlds, agents=agents).reset()
    state["agents", "observation", "audio"] = torch.randn(worlds, agents, 2, 10)
    return state


def values_and_means(ppo, state):
    learner = ppo.algorithms["agents"]
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        acted = learner.network.actor(state.clone())
        value = learner.network.critic(acted)["agents", "state_value"]
    return value.squeeze(-1), acted["agents", "loc"]


def changed(before, after):
    """Return for each agent whether an entry changed in any world."""
    differences = (before - after).abs()
    return differences.reshape(*before.shape[:2], -1).amax((0, 2)) > 1e-6


@pytest.mark.parametrize("critic", list(Critic))
@pytest.mark.parametrize("parameters", list(Parameters))
def test_actors_read_their_own_and_central_critics_all_observations(make_ppo, critic, parameters):
    ppo = make_ppo(network=sized(critic=critic, parameters=parameters), agents=3)
    state = seen(3)
    value, mean = values_and_means(ppo, state)
    state["agents", "observation", "audio"][:, 1] += 3.0
    other_value, other_mean = values_and_means(ppo, state)
    assert changed(mean, other_mean).tolist() == [False, True, False]
    expected = [critic is Critic.central, True, critic is Critic.central]
    assert changed(value, other_value).tolist() == expected


@pytest.mark.parametrize("parameters", list(Parameters))
def test_equal_observations_give_equal_features_only_with_shared_parameters(make_ppo, parameters):
    ppo = make_ppo(network=sized(parameters=parameters), agents=2)
    state = seen(2)
    for array in state["agents", "observation"].values():
        array[:, 1] = array[:, 0]
    features = ppo.algorithms["agents"].network.encoder(state)["agents", "features"]
    alike = torch.allclose(features[:, 0], features[:, 1], atol=1e-6)
    assert alike is (parameters is Parameters.shared)


def test_separate_networks_have_parameters_for_each_agent(make_ppo):
    def count(**options):
        ppo = make_ppo(network=sized(**options), agents=3)
        return sum(p.numel() for p in ppo.algorithms["agents"].network.parameters())

    assert count(parameters=Parameters.separate) == 3 * count()


@pytest.mark.parametrize(
    ("critic", "parameters"),
    [
        # the default is learnt by tests/algos/ppo/test_ppo.py
        pytest.param(Critic.own, Parameters.shared, marks=pytest.mark.slow),
        pytest.param(Critic.own, Parameters.separate, marks=pytest.mark.slow),
        pytest.param(Critic.central, Parameters.shared, marks=pytest.mark.slow),
        (Critic.central, Parameters.separate),
    ],
)
def test_every_combination_learns_the_toy(make_ppo, critic, parameters):
    network = sized(critic=critic, parameters=parameters)
    ppo = make_ppo(network=network, agents=2, senses=("audio",))
    env = FakeEnv(8, agents=2, senses=("audio",))

    def learn():
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            batch = env.rollout(32, ppo.policy.collect, break_when_any_done=False)
        ppo.learn(batch)
        return batch["next", "agents", "reward"].mean().item()

    rewards = rewards_until(0.7, learn, batches=25)
    assert rewards[0] < 0.3
    assert rewards[-1] > 0.7
