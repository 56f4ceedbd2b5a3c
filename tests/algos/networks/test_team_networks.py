"""What the agents of a team share: parameters, and a critic that reads all observations."""

import pytest
import torch
from fake_env import FakeEnv
from torchrl.envs import ExplorationType, set_exploration_type
from training import SMALL, rewards_until

from veca_marl.algos.networks.multisense import Critic, MultisenseCfg, Parameters
from veca_marl.algos.ppo import PPO, PPOCfg
from veca_marl.algos.specs import team_specs


def sized(**options):
    return MultisenseCfg(**{**vars(SMALL), **options})


def seen(agents, worlds=4):
    state = FakeEnv(worlds, agents=agents, global_state=True).reset()
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
    network = sized(critic=critic, parameters=parameters)
    ppo = make_ppo(network=network, agents=3, global_state=True)
    state = seen(3)
    value, mean = values_and_means(ppo, state)
    state["agents", "observation", "audio"][:, 1] += 3.0
    other_value, other_mean = values_and_means(ppo, state)
    assert changed(mean, other_mean).tolist() == [False, True, False]
    expected = [critic is Critic.central, True, critic is Critic.central]
    assert changed(value, other_value).tolist() == expected


@pytest.mark.parametrize("parameters", list(Parameters))
def test_only_a_critic_of_the_state_reads_the_state(make_ppo, parameters):
    ppo = make_ppo(
        network=sized(critic=Critic.state, parameters=parameters), agents=3, global_state=True
    )
    state = seen(3)
    value, mean = values_and_means(ppo, state)
    state["state"][:, 0] += 2.0
    other_value, other_mean = values_and_means(ppo, state)
    assert changed(value, other_value).all()  # of every agent
    assert not changed(mean, other_mean).any()


def test_a_critic_of_the_state_needs_one(make_ppo):
    with pytest.raises(ValueError, match="global_state=true"):
        make_ppo(network=sized(critic=Critic.state))


def test_a_critic_of_the_state_learns_what_no_observation_shows():
    """The reward depends on the state alone, of which the actors have no sense."""
    explained = {}
    for critic in (Critic.own, Critic.state):
        env = FakeEnv(16, global_state=True, horizon=1, senses=("audio",))
        torch.manual_seed(0)
        cfg = PPOCfg(network=sized(critic=critic), gamma=0.0, epochs=8)
        ppo = PPO("agents", team_specs(env)["agents"], cfg, torch.device("cpu"))
        for _ in range(12):
            with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
                batch = env.rollout(16, ppo.actor, break_when_any_done=False)
            batch["agents", "observation", "audio"].zero_()
            batch["agents", "features"].fill_(1.0)
            batch["next", "agents", "reward"] = batch["state"].unsqueeze(-1).clone()
            explained[critic] = ppo.learn(batch)["explained_variance"]
    assert explained[Critic.own] < 0.1
    assert explained[Critic.state] > 0.8


def test_agents_that_see_the_same_act_alike_unless_the_network_tells_them_apart(make_ppo):
    for identity in (False, True):
        ppo = make_ppo(network=sized(agent_identity=identity), agents=3)
        state = seen(3)
        for array in state["agents", "observation"].values():
            array[:] = array[:, :1]
        features = ppo.algorithms["agents"].network.encoder(state)["agents", "features"]
        assert torch.allclose(features[:, 0], features[:, 1]) is not identity


def test_separate_networks_need_no_identity():
    with pytest.raises(ValueError, match=r"agent_identity.*separate"):
        sized(agent_identity=True, parameters=Parameters.separate)


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
