import math
from copy import deepcopy
from dataclasses import replace

import pytest
import torch
from fake_env import FakeEnv
from gae import gae_by_hand
from refusals import naming
from tensordict.nn import TensorDictSequential
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.objectives.value import MultiAgentGAE
from training import SMALL, rewards_until

from veca_marl.algos.collection.experience import CollectCfg, Experience
from veca_marl.algos.networks.multisense import Parameters
from veca_marl.algos.ppo import PPO, PPOCfg
from veca_marl.algos.ppo.advantages import advantages
from veca_marl.algos.specs import team_specs

CPU = torch.device("cpu")


@pytest.mark.parametrize("terminated", [False, True])
@pytest.mark.parametrize("agents", [1, 2])
def test_advantages_equal_the_recursion(make_ppo, agents, terminated):
    ppo = make_ppo(agents=agents)
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = FakeEnv(4, agents=agents, horizon=5).rollout(
            13, ppo.policy.collect, break_when_any_done=False, auto_cast_to_device=False
        )
    if terminated:  # by the rules instead of by the clock: no value after the end
        batch["next", "agents", "terminated"] |= batch["next", "agents", "truncated"]
    learner = ppo.algorithms["agents"]
    found = advantages(learner.network, batch, "agents", 0.99, 0.95)

    with torch.no_grad():  # values the plain way: the network looks at every observation
        network = learner.network
        value = network.critic(network.encoder(batch.clone()))["agents", "state_value"]
        following = network.critic(network.encoder(batch["next"].clone()))["agents", "state_value"]
    team = batch["next", "agents"]
    expected = gae_by_hand(value, following, team["reward"], team["done"], team["terminated"])
    assert batch["next", "done"].any(), "the test must see ends of episodes"
    torch.testing.assert_close(found["advantage"], expected, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(found["value_target"], expected + value, rtol=1e-4, atol=1e-5)


def test_advantages_are_those_of_torchrls_estimator_for_teams(make_ppo):
    """TorchRL's module calls the network on every observation, and on every following one."""
    ppo = make_ppo(agents=2)
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = FakeEnv(4, agents=2, horizon=5).rollout(
            13, ppo.policy.collect, break_when_any_done=False, auto_cast_to_device=False
        )
    network = ppo.algorithms["agents"].network
    found = advantages(network, batch, "agents", 0.99, 0.95)
    whole = TensorDictSequential(network.encoder, network.critic)
    estimator = MultiAgentGAE(gamma=0.99, lmbda=0.95, value_network=whole)
    names = ("reward", "done", "terminated", "advantage", "value_target")
    estimator.set_keys(
        value=("agents", "state_value"), **{name: ("agents", name) for name in names}
    )
    theirs = estimator(batch.clone())
    for name in ("advantage", "value_target"):
        torch.testing.assert_close(found[name], theirs["agents", name], rtol=1e-4, atol=1e-5)


def test_the_divergence_is_measured_against_a_target_for_each_dimension_of_the_action():
    targets = {}
    for form in ({}, {"discrete": True}, {"hybrid": True}):
        spec = team_specs(FakeEnv(1, **form))["agents"]
        ppo = PPO("agents", spec, PPOCfg(network=SMALL, target_kl=0.01), CPU)
        targets[next(iter(form), "vector")] = ppo.schedule.target_kl
    assert targets == pytest.approx({"vector": 0.02, "discrete": 0.01, "hybrid": 0.03})


def test_the_rate_of_the_critic_is_its_own(make_ppo):
    """After a divergence far above the target the actor's rate falls, the critic's does not."""
    ppo = make_ppo().algorithms["agents"]
    rates = ppo.optimizer.param_groups[0], ppo.critic_optimizer.param_groups[0]
    before = [group["lr"] for group in rates]
    ppo.schedule.step(100.0 * ppo.schedule.target_kl)
    assert rates[0]["lr"] < before[0]
    assert rates[1]["lr"] == before[1] == ppo.cfg.critic_learning_rate
    learnt = [p for group in rates for p in group["params"]]
    assert len(learnt) == len({id(p) for p in learnt}) == len(list(ppo.network.parameters()))
    assert len(rates[1]["params"]) == 2  # weight and bias of the value head


def test_first_values_are_close_to_zero(make_ppo):
    network = make_ppo().algorithms["agents"].network
    state = FakeEnv(16).reset()
    values = network.critic(network.encoder(state))["agents", "state_value"]
    assert values.abs().max() < 0.1


@pytest.mark.parametrize(("gamma", "gae_lambda"), [(0.9, 0.0), (0.0, 0.95), (0.0, 0.0)])
def test_advantages_without_decaying_sums_are_errors_of_one_step(make_ppo, gamma, gae_lambda):
    ppo = make_ppo()
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = FakeEnv(4, horizon=5).rollout(
            13, ppo.policy.collect, break_when_any_done=False, auto_cast_to_device=False
        )
    network = ppo.algorithms["agents"].network
    found = advantages(network, batch, "agents", gamma, gae_lambda)
    with torch.no_grad():
        value = network.critic(network.encoder(batch.clone()))["agents", "state_value"]
        following = network.critic(network.encoder(batch["next"].clone()))["agents", "state_value"]
    team = batch["next", "agents"]
    target = team["reward"] + gamma * following * ~team["terminated"]
    torch.testing.assert_close(found["value_target"], target, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(found["advantage"], target - value, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(
    ("discrete", "teams"),
    [
        (False, ("agents",)),
        pytest.param(True, ("red", "blue"), marks=pytest.mark.slow),
    ],
    ids=["one", "two"],
)
def test_toy_is_learnt(make_ppo, discrete, teams):
    env = {"discrete": discrete, "teams": teams}
    ppo = make_ppo(**env)
    player = ppo.policy.copy()
    experience = Experience(
        lambda worlds, seed: FakeEnv(worlds, seed, **env),
        player.collect,
        CollectCfg(1, worlds=8, steps=32, processes=0),
    )
    experience.restart(0)

    def learn():
        batch = experience.collect()
        ppo.learn(batch)
        player.take_over(ppo.policy)
        experience.update_policy()
        return min(batch["next", team, "reward"].mean().item() for team in teams)

    rewards = rewards_until(0.7, learn, batches=16)
    experience.close()
    assert rewards[0] < 0.3
    assert rewards[-1] > 0.7


def test_learning_rate_follows_the_divergence(make_ppo):
    schedule = make_ppo().algorithms["agents"].schedule
    start = schedule.get_last_lr()[0]
    schedule.step(0.017)
    assert schedule.get_last_lr()[0] == pytest.approx(start / 1.5)
    schedule.step(0.003)
    assert schedule.get_last_lr()[0] == pytest.approx(start)
    schedule.step(0.01)
    assert schedule.get_last_lr()[0] == pytest.approx(start)
    for _ in range(20):
        schedule.step(0.001)
    assert schedule.get_last_lr()[0] == PPOCfg().max_learning_rate


def test_rewards_that_are_not_finite_raise_an_error(make_ppo):
    ppo = make_ppo()
    with torch.no_grad():
        batch = FakeEnv(2).rollout(8, ppo.policy.collect, break_when_any_done=False)
    batch["next", "agents", "reward"][:] = math.nan  # whichever minibatch is the first
    before = torch.cat([p.flatten() for p in ppo.policy.parameters()])
    with pytest.raises(FloatingPointError, match=naming("'agents'", "gradient", "nan")):
        ppo.learn(batch)
    assert torch.equal(before, torch.cat([p.flatten() for p in ppo.policy.parameters()]))


def small_ppo(agents=1, **numbers):
    torch.manual_seed(0)
    cfg = PPOCfg(**{"network": SMALL, **numbers})
    return PPO("agents", team_specs(FakeEnv(1, agents=agents))["agents"], cfg, CPU)


def collected(ppo, seed, agents=1):
    torch.manual_seed(seed)
    env = FakeEnv(4, seed, agents=agents)
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        return env.rollout(16, ppo.actor, break_when_any_done=False)


@pytest.mark.parametrize(("epochs", "minibatches"), [(1, 1), (2, 1)])
def test_the_rate_does_not_follow_a_divergence_before_the_first_step(epochs, minibatches):
    ppo = small_ppo(epochs=epochs, minibatches=minibatches, target_kl=1e9)  # never too large
    for seed in range(8):
        rate = ppo.schedule.get_last_lr()[0]
        after = ppo.learn(collected(ppo, seed))["learning_rate"]
        assert after <= rate * 1.5 ** (epochs - 1) + 1e-12


def test_agents_with_networks_of_their_own_learn_independently():
    """The gradient of one agent does not scale that of another one."""
    network = replace(SMALL, parameters=Parameters.separate)
    learnt = []
    for scale in (1.0, 1e4):
        ppo = small_ppo(2, network=network, epochs=1, minibatches=1)
        batch = collected(ppo, 0, agents=2)
        batch["next", "agents", "reward"][:, :, 1] *= scale
        ppo.learn(batch)
        parameters = dict(ppo.network.named_parameters())
        learnt.append({n: p.detach().clone() for n, p in parameters.items() if "agents.0." in n})
    assert learnt[0], "the test must see parameters of the first agent"
    assert all(torch.equal(learnt[0][name], learnt[1][name]) for name in learnt[0])


def test_learning_continues_exactly_from_a_state(make_ppo):
    def batch(ppo, seed):
        torch.manual_seed(seed)
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            return FakeEnv(4, seed).rollout(16, ppo.policy.collect, break_when_any_done=False)

    one, other = make_ppo(), make_ppo(seed=7)
    one.learn(batch(one, 0))
    other.load_state_dict(deepcopy(one.state_dict()))  # as read from a file
    for ppo in (one, other):
        ppo.learn(batch(ppo, 1))
    pairs = zip(one.policy.parameters(), other.policy.parameters(), strict=True)
    assert all(torch.equal(p, q) for p, q in pairs)


@pytest.mark.parametrize(
    "wrong",
    [
        {"gamma": 1.5},
        {"clip": 0.0},
        {"clip": 1.5},
        {"epochs": 0},
        {"learning_rate": 1.0},
        {"target_kl": -1.0},
    ],
)
def test_invalid_numbers_raise_an_error_with_their_name(wrong):
    ((name, number),) = wrong.items()
    with pytest.raises(ValueError, match=naming(f"algo.{name}", number)):
        PPOCfg(**wrong)


def test_defaults_are_the_papers_table():
    cfg = PPOCfg()
    table = (cfg.gamma, cfg.gae_lambda, cfg.clip, cfg.entropy_coefficient, cfg.max_gradient_norm)
    assert table == (0.99, 0.95, 0.2, 0.03, 5.0)
    assert (cfg.epochs, cfg.minibatches, cfg.value_coefficient) == (4, 4, 0.5)
    collect = CollectCfg()
    assert collect.all_worlds == 8
