"""Agents that are eliminated: their rows change neither losses, gradients nor measures."""

import math

import pytest
import torch
from fake_env import FakeEnv
from gae import gae_by_hand
from torch.distributions import kl_divergence
from torchrl.data import Categorical
from torchrl.envs import ExplorationType, check_env_specs, set_exploration_type
from torchrl.modules.distributions.utils import rsample_and_log_prob
from training import SMALL

from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.multisense import Critic, Memory, MultisenseCfg
from veca_marl.algos.ppo import PPO, PPOCfg
from veca_marl.algos.ppo.advantages import Credit, advantages
from veca_marl.algos.ppo.losses import VALID, explained_variance
from veca_marl.algos.ppo.value_normalisation import ValueNormalisation
from veca_marl.algos.specs import team_specs


class LeavingEnv(FakeEnv):
    """The toy with a mask: the second of three agents is eliminated in every second step."""

    def __init__(self, worlds, **options):
        super().__init__(worlds, agents=3, **options)
        self.observation_spec["agents", "mask"] = Categorical(
            2, shape=(worlds, 3), dtype=torch.bool
        )

    def _team(self, right):
        mask = torch.ones(right.shape[:2], dtype=torch.bool)
        mask[:, 1] = torch.from_numpy(self.clock % 2 == 0)
        return super()._team(right).set("mask", mask)


@pytest.fixture(params=list(Critic))
def leaving(request):
    def make(hybrid=False, memory=Memory.none, **numbers):
        env = LeavingEnv(8, hybrid=hybrid, global_state=True)
        torch.manual_seed(0)
        network = MultisenseCfg(**{**vars(SMALL), "critic": request.param, "memory": memory})
        cfg = PPOCfg(network=network, sequence_steps=8, **numbers)
        ppo = PPO("agents", team_specs(env)["agents"], cfg, torch.device("cpu"))
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            batch = with_memory(env, ppo.actor).rollout(16, ppo.actor, break_when_any_done=False)
        return ppo, batch

    return make


def disturbed(rows, mask, size):
    """Return a copy with other observations, advantages and targets where `mask` is False."""
    other = rows.clone()
    for name in ("advantage", "value_target"):
        other["agents", name][~mask] += size
    other["agents", "observation", "audio"][~mask] += size
    other["agents", "observation", "vision"][~mask] = 255
    return other


def move_policy(ppo):
    torch.manual_seed(1)
    with torch.no_grad():
        for p in ppo.network.parameters():
            p.add_(0.2 * torch.randn_like(p))


def step(ppo, rows):
    """Return losses, measures and gradient of one step that changes no parameter."""
    ppo.optimizer.step = ppo.critic_optimizer.step = lambda: None
    torch.manual_seed(0)  # the entropy of a tanh-normal is sampled
    measures = ppo.step(rows)
    return measures, torch.cat([p.grad.flatten() for p in ppo.network.parameters()])


def test_the_toy_with_a_mask_keeps_the_contract_of_torchrl():
    check_env_specs(LeavingEnv(2))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"hybrid": True},
        {"value_normalisation": ValueNormalisation.popart},
        {"memory": Memory.gru},
    ],
    ids=["one_part", "two_parts", "popart", "gru"],
)
def test_masked_rows_change_neither_gradient_nor_measures(leaving, options):
    ppo, batch = leaving(**options)
    rows = ppo.prepare(batch)
    move_policy(ppo)
    mask = rows["agents", "mask"]
    assert 0 < (~mask).sum() < mask.numel()
    measures, gradient = step(ppo, disturbed(rows, mask, 0.0))
    other_measures, other_gradient = step(ppo, disturbed(rows, mask, 50.0))
    assert gradient.abs().max() > 0.0
    torch.testing.assert_close(other_gradient, gradient, rtol=1e-4, atol=1e-5)
    assert other_measures == pytest.approx(measures, rel=1e-4, abs=1e-5)
    assert 0.0 < measures["clip_fraction"] < 1.0, "the test must see clipped ratios"


def test_masked_rows_do_not_enter_the_statistics_of_value_targets(leaving):
    statistics = []
    for size in (0.0, 50.0):
        ppo, batch = leaving(value_normalisation=ValueNormalisation.popart)
        rows = ppo.prepare(batch)
        ppo.learn_rows(disturbed(rows, rows["agents", "mask"], size))
        statistics.append(torch.cat(list(ppo.normalised_critic.statistics.buffers())[:2]))
    assert statistics[0].abs().max() > 0.0
    assert torch.equal(*statistics)


def test_advantages_of_present_agents_ignore_masked_observations(leaving):
    """A central critic must not average in agents that are eliminated: at the end, too."""
    ppo, batch = leaving()
    plain = ppo.prepare(batch.clone())
    for part in (batch, batch["next"]):
        gone = ~part["agents", "mask"]
        part["agents", "observation", "audio"][gone] += 50.0
    # the features of the batch were written while acting: write them again
    with torch.no_grad():
        batch = ppo.network.encoder(batch)
    other = ppo.prepare(batch)
    for name in ("advantage", "value_target"):
        for agent in (0, 2):  # never eliminated
            torch.testing.assert_close(
                plain["agents", name][:, agent], other["agents", name][:, agent]
            )


def test_after_its_elimination_an_agent_can_be_credited_with_what_its_team_gains(leaving):
    ppo, batch = leaving()
    step = batch["next", "agents"]
    step["terminated"][..., 1, :] = ~step["mask"][..., 1:2]
    step["done"] |= step["terminated"]
    numbers = batch, "agents", 0.9, 0.8
    alone = advantages(ppo.network, *numbers, Credit.nothing)
    shared = advantages(ppo.network, *numbers, Credit.team)
    with torch.no_grad():
        value, following = (
            ppo.network.critic(ppo.network.encoder(part.clone()))["agents", "state_value"]
            for part in (batch, batch["next"])
        )
    eliminated = step["terminated"] & ~batch["next", "terminated"].unsqueeze(-1)
    assert eliminated.any()
    mates = following[..., [0, 2], :].mean(-2, keepdim=True).expand_as(following)
    following = torch.where(eliminated, mates, following)
    signals = step["reward"], step["done"], step["terminated"] & ~eliminated
    expected = gae_by_hand(value, following, *signals, 0.9, 0.8)
    torch.testing.assert_close(shared["advantage"], expected, rtol=1e-4, atol=1e-5)
    assert not torch.equal(alone["advantage"][..., 1, :], shared["advantage"][..., 1, :])
    for agent in (0, 2):  # nothing changes for the others
        assert torch.equal(alone["advantage"][..., agent, :], shared["advantage"][..., agent, :])


def test_measures_are_means_over_the_agents_that_are_present(leaving):
    ppo, batch = leaving()
    rows = ppo.prepare(batch)
    move_policy(ppo)
    mask = rows["agents", "mask"]
    with torch.no_grad():
        old = ppo.actor.build_dist_from_params(rows)
        new = ppo.actor.get_dist(rows.clone())
        divergence = kl_divergence(old, new)[mask].mean().item()
        weight = new.log_prob(rows["agents", "action"]) - rows["agents", "action_log_prob"]
        outside = ((weight.exp() < 0.8) | (weight.exp() > 1.2))[mask].float().mean().item()
        torch.manual_seed(0)
        # scored before tanh: where it saturates, a sample alone does not tell its density
        _, log_prob = rsample_and_log_prob(new, (1,))
        entropy = -log_prob[0][mask].mean().item()
    measures, _ = step(ppo, rows)
    assert measures["kl"] == pytest.approx(divergence, rel=1e-4)
    assert measures["clip_fraction"] == pytest.approx(outside, abs=0.01)
    assert measures["entropy"] == pytest.approx(entropy, rel=1e-4)
    assert VALID in rows.keys()  # noqa: SIM118  a TensorDict


def test_explained_variance_is_numpys_over_the_valid_rows():
    torch.manual_seed(0)
    target, value = torch.randn(20, 2, 1), torch.randn(20, 2, 1)
    valid = torch.rand(20, 2, 1) > 0.4
    found = explained_variance(target, value, valid)
    for agent in range(2):
        rows = valid[:, agent, 0]
        error = (target - value)[rows, agent].numpy().var()
        total = target[rows, agent].numpy().var()
        assert found[agent].item() == pytest.approx(1.0 - error / total, rel=1e-4)


def test_the_explained_variance_of_an_absent_agent_is_left_out(leaving):
    rows = torch.randn(20, 2, 1)
    valid = torch.ones(20, 2, 1, dtype=torch.bool)
    valid[:, 1] = False
    assert explained_variance(rows, 0.5 * rows, valid)[:, 0].isnan().tolist() == [False, True]
    ppo, batch = leaving()
    batch["agents", "mask"][..., 1] = False
    measured, _ = step(ppo, ppo.prepare(batch))
    assert measured["explained_variance"] < 0.5, "a critic that has not learnt explains little"


@pytest.mark.parametrize("normalisation", [ValueNormalisation.none, ValueNormalisation.popart])
def test_minibatches_without_present_agents_are_left_out(leaving, normalisation):
    ppo, batch = leaving(value_normalisation=normalisation)
    batch["agents", "mask"][:, 8:] = False  # half of the rows, minibatches of one row
    ppo.cfg.minibatches, ppo.cfg.epochs = batch.numel(), 1
    measured = ppo.learn(batch)
    assert all(math.isfinite(number) for number in measured.values())


def test_a_batch_without_present_agents_changes_nothing(leaving):
    ppo, batch = leaving(value_normalisation=ValueNormalisation.running)
    batch["agents", "mask"][:] = False
    before = {name: array.clone() for name, array in ppo.network.state_dict().items()}
    measured = ppo.learn(batch)
    assert math.isnan(measured["policy_loss"])
    after = ppo.network.state_dict()
    assert all(torch.equal(before[name], after[name]) for name in before)
