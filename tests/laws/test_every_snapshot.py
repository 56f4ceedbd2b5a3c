"""From a snapshot, every task continues as it went on."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from paths import HELPERS
from rollouts import EPISODE, digest, fill_actions, game_cfg

from veca_marl.envs.adapters.torchrl.env import VecaEnv

BEFORE, AFTER = 6, EPISODE + 3  # beyond the end of the episode and the reset that follows


def continued(env, state, seed=7):
    """Play random actions from a state; return all steps and the last state."""
    rng, steps = np.random.default_rng(seed), []
    for _ in range(AFTER):
        fill_actions(env, state, rng)
        played, state = env.step_and_maybe_reset(state)
        steps.append(played["next"].clone())
    return torch.stack(steps, -1)


def begun(env):
    env.set_seed(3)
    state, rng = env.reset(), np.random.default_rng(3)
    for _ in range(BEFORE):
        fill_actions(env, state, rng)
        _, state = env.step_and_maybe_reset(state)
    return state


def test_a_restored_world_continues_as_it_went_on(env):
    state = begun(env)
    snapshots = env.snapshot()
    went_on = continued(env, state.clone())
    observed = env.restore(snapshots)
    for team in env.group_map:
        for sense, seen in state[team, "observation"].items():
            assert torch.equal(observed[team, "observation", sense], seen), sense
    assert digest(continued(env, observed)) == digest(went_on)


def test_a_snapshot_of_one_world_is_restored_in_another(env):
    state = begun(env)
    (first,) = env.snapshot([0])
    went_on = continued(env, state)
    both = env.restore(first)
    rng, steps = np.random.default_rng(7), []
    for _ in range(AFTER):
        fill_actions(env, both, rng)
        for team in env.group_map:
            both[team] = both[team].apply(lambda each: torch.stack([each[0]] * env.batch_size[0]))
        played, both = env.step_and_maybe_reset(both)
        steps.append(played["next"].clone())
    played = torch.stack(steps, -1)
    for world in range(env.batch_size[0]):
        assert digest(played[world]) == digest(went_on[0])


PROGRAM = """
import sys
from rollouts import digest
from test_every_snapshot import continued
from rollouts import game_cfg, SHORT
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.snapshot import Snapshot
task, path = sys.argv[1:]
env = VecaEnv(game_cfg(task, "own", SHORT), 1, seed=11)
print(digest(continued(env, env.restore(Snapshot.load(path)))))
"""


SLOW = [pytest.param(one, marks=pytest.mark.slow) for one in ("GrabObject", "BabyzumasRevenge")]


@pytest.mark.parametrize("one", ["KickTheBall", *SLOW])
def test_a_stored_snapshot_continues_in_another_process(one, tmp_path):
    env = VecaEnv(game_cfg(one, "own", "task.max_seconds=0.4"), 1, seed=0)
    state = begun(env)
    env.snapshot()[0].save(tmp_path / "here.veca")
    went_on = digest(continued(env, state))
    env.close()
    path = f"{HELPERS}:{HELPERS.parent / 'laws'}"
    command = [sys.executable, "-c", PROGRAM, one, str(tmp_path / "here.veca")]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path},
                          capture_output=True, text=True, check=True)  # fmt: skip
    assert done.stdout.split()[-1] == went_on
