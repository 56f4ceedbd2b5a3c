"""What the agents of a team share: parameters, a critic that sees all, rows that do not count."""

import pytest
import torch
from fake_env import FakeEnv
from torch.distributions import kl_divergence
from torchrl.envs import ExplorationType, set_exploration_type
from training import SMALL

from veca_marl.algos.networks.multisense import Critic, MultisenseCfg, Parameters
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners


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
    """Say for which agents anything has changed in any world."""
    differences = (before - after).abs()
    return differences.reshape(*before.shape[:2], -1).amax((0, 2)) > 1e-6


@pytest.mark.parametrize("critic", list(Critic))
@pytest.mark.parametrize("parameters", list(Parameters))
def test_actors_see_their_own_and_central_critics_the_team(make_ppo, critic, parameters):
    ppo = make_ppo(network=sized(critic=critic, parameters=parameters), agents=3)
    state = seen(3)
    value, mean = values_and_means(ppo, state)
    state["agents", "observation", "audio"][:, 1] += 3.0
    other_value, other_mean = values_and_means(ppo, state)
    assert changed(mean, other_mean).tolist() == [False, True, False]
    expected = [critic is Critic.central, True, critic is Critic.central]
    assert changed(value, other_value).tolist() == expected


@pytest.mark.parametrize("parameters", list(Parameters))
def test_agents_with_one_observation_act_alike_only_if_they_share(make_ppo, parameters):
    ppo = make_ppo(network=sized(parameters=parameters), agents=2)
    state = seen(2)
    for array in state["agents", "observation"].values():
        array[:, 1] = array[:, 0]
    features = ppo.algorithms["agents"].network.encoder(state)["agents", "features"]
    alike = torch.allclose(features[:, 0], features[:, 1], atol=1e-6)
    assert alike is (parameters is Parameters.shared)


def test_separate_networks_count_the_agents(make_ppo):
    def count(**options):
        ppo = make_ppo(network=sized(**options), agents=3)
        return sum(p.numel() for p in ppo.algorithms["agents"].network.parameters())

    assert count(parameters=Parameters.separate) == 3 * count()


@pytest.mark.parametrize("critic", list(Critic))
@pytest.mark.parametrize("parameters", list(Parameters))
def test_all_of_them_learn_the_toy(make_ppo, critic, parameters):
    network = sized(critic=critic, parameters=parameters)
    ppo = make_ppo(network=network, agents=2, senses=("audio",))
    env = FakeEnv(8, agents=2, senses=("audio",))
    rewards = []
    for _ in range(25):
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            batch = env.rollout(32, ppo.policy.collect, break_when_any_done=False)
        ppo.learn(batch)
        rewards.append(batch["next", "agents", "reward"].mean().item())
    assert rewards[0] < 0.3
    assert rewards[-1] > 0.7


# ---- rows that do not count


class LeavingEnv(FakeEnv):
    """The toy with a mask: the second agent is out in every second step."""

    def __init__(self, worlds, **options):
        super().__init__(worlds, agents=2, **options)
        mask = self.observation_spec["agents", "info", "right"].squeeze(-1)
        self.observation_spec["agents", "mask"] = type(self.full_done_spec["done"])(
            2, shape=mask.shape, dtype=torch.bool
        )

    def _team(self, right):
        team = super()._team(right)
        mask = torch.ones(right.shape[:2], dtype=torch.bool)
        mask[:, 1] = torch.from_numpy(self.clock % 2 == 0)
        return team.set("mask", mask)


@pytest.fixture
def leaving(make_ppo):
    env = LeavingEnv(8)
    torch.manual_seed(0)
    ppo = TeamLearners(team_specs(env), PPOCfg(network=SMALL), torch.device("cpu"))
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = env.rollout(16, ppo.policy.collect, break_when_any_done=False)
    return ppo, ppo.algorithms["agents"].prepare(batch)


def test_rows_that_do_not_count_change_nothing(leaving):
    """Nonsense in the masked rows leaves every gradient as it was."""
    ppo, rows = leaving
    learner = ppo.algorithms["agents"]
    mask = rows["agents", "mask"]
    assert 0 < (~mask).sum() < mask.numel()
    gradients = []
    for nonsense in (0.0, 50.0):
        told = rows.clone()
        for name in ("advantage", "value_target"):
            told["agents", name][~mask] += nonsense
        told["agents", "observation", "audio"][~mask] += nonsense
        learner.optimizer.step = lambda: None  # keep the gradient to look at
        torch.manual_seed(0)  # the entropy of a tanh-normal is sampled
        learner.step(told)
        gradients.append(torch.cat([p.grad.flatten() for p in learner.network.parameters()]))
    assert gradients[0].abs().max() > 0.0
    torch.testing.assert_close(*gradients, rtol=1e-4, atol=1e-6)


def test_the_divergence_is_that_of_the_rows_that_count(leaving):
    ppo, rows = leaving
    learner = ppo.algorithms["agents"]
    with torch.no_grad():
        for p in learner.network.actor.parameters():
            p.add_(0.1 * torch.randn_like(p))
        old = learner.network.actor.build_dist_from_params(rows)
        new = learner.network.actor.get_dist(rows.clone())
        counted = kl_divergence(old, new)[rows["agents", "mask"]].mean().item()
    learner.optimizer.step = lambda: None
    assert learner.step(rows)["kl"] == pytest.approx(counted, rel=1e-4)
