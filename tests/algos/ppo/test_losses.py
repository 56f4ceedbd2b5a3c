"""The loss of TorchRL compared with formulas written by hand."""

import pytest
import torch
from fake_env import FakeEnv
from torch.distributions import Categorical, Normal, kl_divergence
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.objectives.multiagent import MAPPOLoss


def perturb(ppo, scale=0.05):
    """Change the parameters, so that ratios and divergences are not trivial."""
    torch.manual_seed(1)
    with torch.no_grad():
        for p in ppo.policy.parameters():
            p.add_(scale * torch.randn_like(p))


def minibatch(ppo, agents, **env):
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = FakeEnv(8, agents=agents, **env).rollout(
            16, ppo.policy.collect, break_when_any_done=False, auto_cast_to_device=False
        )
    return ppo.algorithms["agents"].prepare(batch)


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("agents", [1, 2])
def test_loss_equals_the_formula(make_ppo, discrete, agents):
    ppo = make_ppo(discrete=discrete, agents=agents)
    rows = minibatch(ppo, agents, discrete=discrete)
    perturb(ppo, scale=0.2)
    learner = ppo.algorithms["agents"]
    out = learner.loss(rows)

    team = rows["agents"]
    with torch.no_grad():
        features = learner.network.encoder(rows.clone())["agents", "features"]
        value = learner.network.critic.module(features)
        new = learner.network.actor.get_dist(rows.clone())
    advantage = team["advantage"]
    advantage = (advantage - advantage.mean(0)) / advantage.std(0)  # each agent by itself
    ratio = (new.log_prob(team["action"]) - team["action_log_prob"]).exp().unsqueeze(-1)
    clipped = ratio.clamp(0.8, 1.2)
    objective = -torch.minimum(ratio * advantage, clipped * advantage).mean()
    torch.testing.assert_close(out["loss_objective"], objective, rtol=1e-4, atol=1e-5)
    critic = 0.5 * ((team["value_target"] - value) ** 2).mean()
    torch.testing.assert_close(out["loss_critic"].detach(), critic, rtol=1e-4, atol=1e-5)
    outside = ((ratio < 0.8) | (ratio > 1.2)).float().mean()
    torch.testing.assert_close(out["clip_fraction"], outside, rtol=0.0, atol=0.02)
    assert outside > 0.02, "the test must see clipped ratios"
    if discrete:
        entropy = new.entropy().mean()
        torch.testing.assert_close(out["entropy"], entropy, rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(out["loss_entropy"].detach(), -0.03 * entropy)


@pytest.mark.parametrize("discrete", [False, True])
def test_loss_and_gradient_are_those_of_torchrls_mappo(make_ppo, discrete):
    ppo = make_ppo(discrete=discrete, agents=2)
    rows = minibatch(ppo, 2, discrete=discrete)
    perturb(ppo, scale=0.2)
    learner = ppo.algorithms["agents"]
    theirs = MAPPOLoss(
        learner.network.actor,
        learner.network.critic,
        clip_epsilon=learner.cfg.clip,
        entropy_coeff=learner.cfg.entropy_coefficient,
        critic_coeff=learner.cfg.value_coefficient,
        loss_critic_type="l2",
        functional=False,
    )
    theirs.set_keys(
        value=("agents", "state_value"),
        **{name: ("agents", name) for name in ("reward", "done", "terminated")},
        **{name: ("agents", name) for name in ("advantage", "value_target")},
    )
    found = []
    for loss in (learner.loss, theirs):
        torch.manual_seed(2)  # the entropy of a tanh-normal is sampled
        out = loss(rows.clone())
        learner.network.zero_grad()
        parts = [out[name] for name in ("loss_objective", "loss_critic", "loss_entropy")]
        sum(parts).backward()
        gradient = torch.cat([p.grad.flatten() for p in learner.network.parameters()])
        found.append((*(part.detach() for part in parts), gradient))
    torch.testing.assert_close(found[0], found[1], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("discrete", [False, True])
def test_reported_divergence_is_exact(make_ppo, discrete):
    """Covers the private hook of TorchRL that `TeamPPOLoss` overrides."""
    ppo = make_ppo(discrete=discrete)
    rows = minibatch(ppo, 1, discrete=discrete)
    learner = ppo.algorithms["agents"]
    assert learner.loss(rows)["kl_approx"] == pytest.approx(0.0, abs=1e-6)
    perturb(ppo)
    reported = learner.loss(rows)["kl_approx"]

    team = rows["agents"]
    with torch.no_grad():
        now = learner.network.actor.get_dist_params(rows.clone())["agents"]
    if discrete:
        exact = kl_divergence(Categorical(logits=team["logits"]), Categorical(logits=now["logits"]))
    else:  # the tanh is the same bijection on both sides and drops out
        old, new = Normal(team["loc"], team["scale"]), Normal(now["loc"], now["scale"])
        exact = kl_divergence(old, new).sum(-1)
    assert reported > 1e-4
    torch.testing.assert_close(reported, exact.mean(), rtol=1e-4, atol=1e-6)


def test_value_head_alone_as_critic_gives_the_gradient_of_the_whole(make_ppo):
    """The features the critic reads are those of this forward pass, with their gradient."""
    ppo = make_ppo()
    rows = minibatch(ppo, 1)
    learner = ppo.algorithms["agents"]
    first_layer = learner.network.encoder.module.encoders["vision"].layers[0].weight

    learner.loss(rows)["loss_critic"].backward()
    shared = first_layer.grad.clone()
    first_layer.grad = None
    features = learner.network.encoder(rows.clone())["agents", "features"]
    error = rows["agents", "value_target"] - learner.network.critic.module(features)
    (0.5 * error.square().mean()).backward()
    torch.testing.assert_close(shared, first_layer.grad)
    assert shared.abs().max() > 0
