"""Actions of several named parts: each is drawn, learnt and counted in every measure."""

import pytest
import torch
from fake_env import FakeEnv
from torch.distributions import Categorical, Normal, kl_divergence
from torchrl.envs import ExplorationType, check_env_specs, set_exploration_type
from training import rewards_until

from veca_marl.algos.specs import ActionLayout, team_specs


def play(ppo, steps, **env):
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        env = FakeEnv(8, hybrid=True, **env)
        return env.rollout(steps, ppo.policy.collect, break_when_any_done=False)


def move_policy(ppo, scale):
    torch.manual_seed(1)
    with torch.no_grad():
        for p in ppo.policy.parameters():
            p.add_(scale * torch.randn_like(p))


def test_the_toy_with_two_parts_keeps_the_contract_of_torchrl():
    check_env_specs(FakeEnv(2, hybrid=True, agents=2))


def test_parts_are_read_from_the_spec():
    actions = team_specs(FakeEnv(1, hybrid=True))["agents"].actions
    assert actions == {
        "move": ActionLayout(discrete=False, size=2),
        "voice": ActionLayout(discrete=True, size=2),
    }
    assert team_specs(FakeEnv(1))["agents"].actions == {"action": ActionLayout(False, 2)}


@pytest.mark.parametrize("agents", [1, 2])
def test_every_part_is_within_its_spec(make_ppo, agents):
    env = FakeEnv(4, hybrid=True, agents=agents)
    acted = make_ppo(hybrid=True, agents=agents).policy.play(env.reset())
    spec = env.full_action_spec["agents", "action"]
    for part in ("move", "voice"):
        assert spec[part].is_in(acted["agents", "action", part])


def test_ratio_entropy_and_divergence_are_over_all_parts(make_ppo):
    ppo = make_ppo(hybrid=True)
    rows = ppo.algorithms["agents"].prepare(play(ppo, 16))
    move_policy(ppo, 0.1)
    learner = ppo.algorithms["agents"]
    torch.manual_seed(0)  # the entropy of the continuous part is sampled
    out = learner.loss(rows.clone())

    team = rows["agents"]
    with torch.no_grad():
        now = learner.network.actor.get_dist_params(rows.clone())["agents", "parameters"]
        new = learner.network.actor.get_dist(rows.clone())
    heads = new.dists.items()
    log_prob = sum(head.log_prob(rows[key]) for key, head in heads)
    old_log_prob = team["action", "move_log_prob"] + team["action", "voice_log_prob"]
    advantage = team["advantage"]
    advantage = (advantage - advantage.mean(0)) / advantage.std(0)
    ratio = (log_prob - old_log_prob).exp().unsqueeze(-1)
    objective = -torch.minimum(ratio * advantage, ratio.clamp(0.8, 1.2) * advantage).mean()
    torch.testing.assert_close(out["loss_objective"], objective, rtol=1e-4, atol=1e-5)

    old = team["parameters"]
    normals = [Normal(p["move", "loc"], p["move", "scale"]) for p in (old, now)]
    choices = [Categorical(logits=p["voice", "logits"]) for p in (old, now)]
    exact = kl_divergence(*normals).sum(-1) + kl_divergence(*choices)
    torch.testing.assert_close(out["kl_approx"], exact.mean(), rtol=1e-4, atol=1e-6)
    torch.manual_seed(0)
    sampled = new["agents", "action", "move"].rsample((1,))
    entropy = -new["agents", "action", "move"].log_prob(sampled).mean()
    entropy = entropy + new["agents", "action", "voice"].entropy().mean()
    torch.testing.assert_close(out["entropy"], entropy, rtol=1e-4, atol=1e-5)


def test_both_parts_are_learnt(make_ppo):
    ppo = make_ppo(hybrid=True, senses=("audio",))

    def learn():
        batch = play(ppo, 32, senses=("audio",))
        ppo.learn(batch)
        return batch["next", "agents", "reward"].mean().item()

    rewards = rewards_until(0.7, learn, batches=20)
    assert rewards[0] < 0.3
    assert rewards[-1] > 0.7  # one part alone reaches 0.5 at most
