"""The weight of the entropy bonus: one number, or one for each part of the action."""

import pytest
import torch
from fake_env import FakeEnv
from refusals import naming
from torchrl.envs import ExplorationType, set_exploration_type
from training import SMALL

from veca_marl.algos.ppo import PPO, PPOCfg
from veca_marl.algos.specs import team_specs
from veca_marl.config import ConfigError, compose
from veca_marl.runs.assembly import make_trainer

BOTH = {"move": 0.2, "voice": 0.5}


def losses(coefficient, **env):
    """Return the losses of one minibatch, which is the same for every coefficient."""
    env = FakeEnv(4, **env)
    torch.manual_seed(0)
    cfg = PPOCfg(network=SMALL, entropy_coefficient=coefficient)
    ppo = PPO("agents", team_specs(env)["agents"], cfg, torch.device("cpu"))
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        rows = ppo.prepare(env.rollout(8, ppo.actor, break_when_any_done=False))
    torch.manual_seed(1)  # the entropy of a tanh-normal is sampled
    return ppo.loss(rows)


@pytest.mark.parametrize("agents", [1, 2])
def test_each_part_has_its_weight(agents):
    out = losses(BOTH, hybrid=True, agents=agents)
    parts = out["composite_entropy"]["agents", "action"]
    expected = -sum(BOTH[name] * parts[f"{name}_entropy"].mean() for name in BOTH)
    torch.testing.assert_close(out["loss_entropy"].detach(), expected)


def test_equal_weights_are_one_number():
    mapping, number = (
        losses(c, hybrid=True)["loss_entropy"] for c in ({"move": 0.3, "voice": 0.3}, 0.3)
    )
    torch.testing.assert_close(mapping, number)
    torch.testing.assert_close(losses({"action": 0.3})["loss_entropy"], losses(0.3)["loss_entropy"])


@pytest.mark.parametrize("wrong", [{"move": 0.1}, {**BOTH, "fly": 0.1}])
def test_other_names_than_the_parts_are_refused(wrong):
    with pytest.raises(ValueError, match=naming(sorted(wrong), "['move', 'voice']")):
        losses(wrong, hybrid=True)


@pytest.mark.parametrize("wrong", ["high", None, True, float("nan"), {}, {"move": "low"}])
def test_what_is_not_a_number_is_refused(wrong):
    with pytest.raises(ValueError, match=naming("algo.entropy_coefficient", repr(wrong))):
        PPOCfg(entropy_coefficient=wrong)


def test_the_command_line_takes_a_mapping_and_checks_it():
    words = ["+task=KickTheBall", "senses/vision=blind", "algo.entropy_coefficient={move:0.01}"]
    cfg = compose(words)
    assert cfg.algo.entropy_coefficient == {"move": 0.01}
    with pytest.raises(ConfigError, match=naming("['move']", "['action']")):
        make_trainer(cfg, None)
