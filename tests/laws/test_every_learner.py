"""SAC and its presets make a learner for every task and kind of action.

`tests/algos/sac/test_forms.py` does the same, quickly, with the forms of specifications.
"""

import math

import pytest
import torch
from composed import compose
from random_batches import random_batch
from rollouts import game_cfg

from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.runs.assembly import read_specs

PRESETS = ("sac", "sac_fast", "crossq")


@pytest.fixture(scope="module")
def specs(task, kind):
    return read_specs(game_cfg(task, kind))


@pytest.mark.slow  # makes a world of every task
@pytest.mark.parametrize("preset", PRESETS)
def test_it_learns_from_batches_of_every_task(specs, preset, numbers):
    torch.manual_seed(0)
    batch = random_batch(specs)
    for team, spec in specs.items():
        learner = make_algorithm(team, spec, numbers[preset], torch.device("cpu"))
        measured = learner.learn(batch)
        assert list(measured) == list(learner.measures)
        assert all(math.isfinite(value) for value in measured.values())
        assert measured["updates"] == batch.numel() * numbers[preset].updates_per_frame


@pytest.fixture(scope="module")
def numbers():
    """The presets with a small replay buffer and updates from the first batch on."""
    found = {}
    for preset in PRESETS:
        cfg = compose(["+task=KickTheBall", f"algo={preset}"]).algo
        cfg.replay, cfg.batch_size = ReplayCfg(64, warm_up_frames=1), 4
        found[preset] = cfg
    return found
