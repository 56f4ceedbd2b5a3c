"""examples/guided, which uses only what the guides describe: it passes its checks and trains."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GUIDED = ROOT / "examples" / "guided"
PLUGIN = "plugins=[veca_marl_guided]"

CHECK_TASKS = """
import veca_marl
from veca_marl.checks import CheckCfg
from veca_marl_guided.lead_by_voice import LeadByVoice
from veca_marl_guided.warmth import WarmHands

helped = ["opponent.follower=expert"]  # otherwise it acts at random
for report in (
    veca_marl.check_task(LeadByVoice, overrides=helped, checks=CheckCfg(episodes=16)),
    veca_marl.check_task(WarmHands, checks=CheckCfg(starts=10)),
):
    print(report)
    assert report.passed
"""

PROPERTIES = """
import numpy as np
import veca_marl
from veca_marl.config import ConfigError

chosen = dict(plugins=["veca_marl_guided"], seed=0)
env = veca_marl.make("LeadByVoice", **chosen)
rollout = env.rollout(40)
for team, hears in (("leader", True), ("follower", False)):
    audio = rollout["next", team, "observation", "audio"]
    called = rollout[team, "action", "voice"].any()
    assert called or bool((audio > -8.0).any()) == hears, team
env.close()
try:
    veca_marl.make("LeadByVoice", body="walker", **chosen)
except ConfigError as error:
    assert "voice" in str(error)
else:
    raise AssertionError("a body without a voice was taken")
env = veca_marl.make("WarmHands", **chosen)
warmth = env.rollout(5)["agents", "observation", "warmth"]
assert warmth.shape[-1] == 2 and 0.0 < warmth.min() <= warmth.max() < 1.0
env.close()
"""


def run(folder, *words):
    """Run Python where the package can be imported; it registers what other tests must not see."""
    paths = os.pathsep.join(map(str, (ROOT, GUIDED)))
    environment = {**os.environ, "PYTHONPATH": paths}
    command = [sys.executable, *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_its_tasks_pass_their_checks_with_the_presets_of_the_package(tmp_path):
    run(tmp_path, "-c", CHECK_TASKS)


def test_only_the_leader_hears_the_beeper_a_voice_is_required_and_palms_feel_warmth(tmp_path):
    run(tmp_path, "-c", PROPERTIES)


@pytest.mark.slow
def test_its_algorithm_learns_actions_of_two_parts_with_its_network(tmp_path):
    words = ["algo=guided_reinforce", "algo/network=compared_ears", "collect=one_process"]
    words += ["collect.worlds=2", "collect.steps=16", "total_frames=64", "task.max_seconds=2"]
    words += ["eval.episodes=1", "eval.final_episodes=1", "eval.worlds=1", "log=csv"]
    words += ["hydra.run.dir=run"]
    run(tmp_path, "-m", "veca_marl.train", PLUGIN, "+task=LeadByVoice", *words)
    metrics = (tmp_path / "run" / "metrics.csv").read_text(encoding="utf-8")
    assert "leader/policy_loss" in metrics
    assert "follower/policy_loss" in metrics
