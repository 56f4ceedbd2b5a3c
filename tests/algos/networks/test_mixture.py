"""Mixtures of normal distributions as policies."""

import math

import pytest
import torch
from demonstrated import demonstrations_of_toy
from fake_env import FakeEnv
from refusals import naming
from tensordict import TensorDict
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.modules import TanhNormal
from training import SMALL

from veca_marl.algos.acting import DirectPolicy, draw_tanh_normal
from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.cloning import BCCfg
from veca_marl.algos.imitation.loss import ImitationLoss
from veca_marl.algos.networks.factory import make_network
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.mixture import TanhNormalMixture, draw_mixture
from veca_marl.algos.networks.multisense import Memory, MultisenseCfg, Parameters
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.specs import ActionLayout, team_specs

FORMS = [{}, {"hybrid": True}, {"agents": 2}]


def network(**numbers):
    return MultisenseCfg(**{**vars(SMALL), "modes": 3, **numbers})


def mixture(*batch, modes=3, size=2):
    loc = torch.randn(*batch, modes, size)
    return TanhNormalMixture(loc, 0.1 + torch.rand_like(loc), torch.randn(*batch, modes))


def test_the_density_has_the_integral_one():
    policy = mixture(5, size=1)
    edges = torch.linspace(-1.0, 1.0, 20_001)
    action = 0.5 * (edges[1:] + edges[:-1])
    density = policy.log_prob(action[:, None, None].expand(-1, 5, 1)).exp()
    torch.testing.assert_close(density.mean(0) * 2.0, torch.ones(5), atol=0.02, rtol=0.0)


def test_one_normal_distribution_is_that_of_torchrl():
    policy = mixture(7, modes=1)
    alone = TanhNormal(policy.loc[:, 0], policy.scale[:, 0], low=-1.0, high=1.0)
    action = policy.sample()
    torch.testing.assert_close(policy.log_prob(action), alone.log_prob(action))
    drawn, log_prob = draw_mixture(False, policy.loc, policy.scale, policy.logits)
    expected = draw_tanh_normal(False, policy.loc[:, 0], policy.scale[:, 0])
    torch.testing.assert_close((drawn, log_prob), expected)


def test_equal_normal_distributions_are_one_whatever_their_weights():
    one = mixture(7, modes=1)
    loc, scale = one.loc.expand(7, 4, 2), one.scale.expand(7, 4, 2)
    several = TanhNormalMixture(loc, scale, torch.randn(7, 4))
    action = one.sample()
    torch.testing.assert_close(several.log_prob(action), one.log_prob(action))


def test_samples_have_the_weights():
    loc = torch.tensor([[-2.0], [2.0]])
    policy = TanhNormalMixture(loc, torch.full((2, 1), 0.1), torch.tensor([0.25, 0.75]).log())
    sampled = policy.sample((20_000,))
    assert sampled.shape == (20_000, 1)
    assert sampled.abs().min() > 0.9
    positive = float((sampled > 0.0).float().mean())
    assert positive == pytest.approx(0.75, abs=6.0 * math.sqrt(0.75 * 0.25 / 20_000))
    assert policy.deterministic_sample == pytest.approx(math.tanh(2.0))


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("kind", [ExplorationType.RANDOM, ExplorationType.DETERMINISTIC])
def test_the_direct_form_gives_the_actions_and_probabilities_of_the_distribution(form, kind):
    env = FakeEnv(6, seed=0, **form)
    actor = make_network("agents", team_specs(env)["agents"], network()).actor
    with torch.no_grad(), set_exploration_type(kind):
        played = env.rollout(4, DirectPolicy(actor), break_when_any_done=False)
        policy, key = actor.get_dist(played), ("agents", "action")
        if form.get("hybrid"):
            policy, key = policy.dists["agents", "action", "move"], (*key, "move")
    written = played[*key[:-1], f"{key[-1]}_log_prob"]
    torch.testing.assert_close(policy.log_prob(played[key]), written, atol=1e-3, rtol=1e-3)
    if kind is ExplorationType.DETERMINISTIC:
        torch.testing.assert_close(policy.deterministic_sample, played[key])


def test_each_normal_distribution_begins_elsewhere():
    actor = make_network("agents", team_specs(FakeEnv(1))["agents"], network(modes=5)).actor
    loc = actor.get_dist(FakeEnv(1, seed=0).reset()).loc.squeeze(0).squeeze(0)
    assert (torch.pdist(loc) > 0.1).all()


@pytest.mark.parametrize(
    ("form", "numbers"),
    [
        ({}, {}),
        ({"hybrid": True}, {"memory": Memory.gru}),
        ({"agents": 2}, {"parameters": Parameters.separate}),
    ],
    ids=str,
)
def test_cloning_learns_by_a_mixture(tmp_path, form, numbers):
    torch.manual_seed(0)
    cfg = network(**numbers)
    sizes = {"batch_size": 32, "sequence_steps": 8, "burn_in": 2}
    spec = team_specs(FakeEnv(1, **form))["agents"]
    learner = make_algorithm(
        "agents", spec, BCCfg(network=cfg, learning_rate=3e-3, **sizes), torch.device("cpu")
    )
    learner.take_demonstrations(demonstrations_of_toy(tmp_path, 8, **form))
    learner.learn(TensorDict({}, [1, 3200]))
    toy = with_memory(FakeEnv(16, seed=5, **form), learner.actor)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        played = toy.rollout(8, learner.actor, break_when_any_done=False)
    assert float(played["next", "agents", "reward"].mean()) > 0.9


def fitted(modes, shown):
    """Return a distribution that was fitted to actions, and the loss at the end.

    All of them were shown for one observation, which does not tell which of them is to be taken.
    """
    spec = team_specs(FakeEnv(1))["agents"]
    actor = make_network("agents", spec, network(modes=modes)).actor
    rows = FakeEnv(1, seed=0).reset().expand(len(shown)).clone()
    rows["agents", "action"] = shown.view(-1, 1, 1).expand(-1, 1, 2).clone()
    loss, counted = ImitationLoss("agents", spec.actions, 0.2), torch.ones(len(shown), 1).bool()
    optimizer = torch.optim.Adam(actor.parameters(), 3e-3)
    for _ in range(400):
        found = loss(actor.get_dist(rows), rows, counted).loss
        optimizer.zero_grad()
        found.backward()
        optimizer.step()
    return actor.get_dist(rows[:1]), float(found.detach())


def test_of_two_ways_a_mixture_takes_one_and_a_normal_distribution_their_mean():
    shown = torch.tensor([-0.8, 0.8]).repeat(32)
    one, loss_of_one = fitted(1, shown)
    several, loss_of_several = fitted(4, shown)
    assert one.deterministic_sample.abs().max() < 0.3
    assert (several.deterministic_sample.abs() - 0.8).abs().max() < 0.2
    assert loss_of_several < loss_of_one - 0.2


def test_the_loss_of_a_mixture_is_an_upper_bound_of_its_cross_entropy():
    layout = {"action": ActionLayout(False, 2)}
    policy, least = mixture(4, 1), 0.3
    shown = 0.9 * torch.tanh(torch.randn(4, 1, 2))
    loss = ImitationLoss("agents", layout, least, {"action": ("agents", "action")})
    rows = TensorDict({"agents": {"action": shown}}, [4])
    found = loss(policy, rows, torch.ones(4, 1, dtype=torch.bool)).loss
    normal = shown.atanh() + least * torch.randn(40_000, *shown.shape)
    jacobian = (1.0 - normal.tanh() ** 2).clamp_min(1e-30).log().sum(-1)
    likelihood = policy.log_prob(normal.tanh().clamp(-1 + 1e-6, 1 - 1e-6)) + jacobian
    assert float(found) > -float(likelihood.mean()) / 2 - 0.01


@pytest.mark.parametrize("cfg", [PPOCfg, SACCfg])
def test_algorithms_that_need_an_entropy_refuse_a_mixture(cfg):
    with pytest.raises(ValueError, match=naming("algo.network.modes", "3", "bc", "dagger")):
        cfg(network=network())


def test_ppo_does_not_start_from_a_mixture():
    def make(cfg):
        return make_algorithm("agents", team_specs(FakeEnv(1))["agents"], cfg, torch.device("cpu"))

    with pytest.raises(ValueError, match=naming("modes=3", " 1 ")):
        make(PPOCfg(network=SMALL)).init_from(make(BCCfg(network=network())))


@pytest.mark.parametrize("modes", [0, -1, 10**9])
def test_a_mixture_has_some_distributions(modes):
    with pytest.raises(ValueError, match=naming("modes", str(modes))):
        network(modes=modes)
