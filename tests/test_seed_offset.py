"""``--seed-offset`` moves the seeds of tests and of their child processes alike."""

import subprocess
import sys

import numpy as np
import pytest
import torch

DRAW = """
import numpy as np, torch
torch.manual_seed(5)
drawn = [np.random.default_rng(seed).random() for seed in (0, [0, 1])]
print(*drawn, torch.rand(1).item())
"""


def test_child_processes_draw_what_this_one_draws():
    child = subprocess.run([sys.executable, "-c", DRAW], capture_output=True, text=True, check=True)
    torch.manual_seed(5)
    here = [np.random.default_rng(0).random(), np.random.default_rng([0, 1]).random()]
    assert [float(number) for number in child.stdout.split()] == [*here, torch.rand(1).item()]


def test_equal_seeds_stay_equal_and_others_differ():
    first, again, other = (np.random.default_rng(seed).random() for seed in (3, 3, 4))
    assert first == again != other


def test_the_offset_moves_seeds(pytestconfig):
    original = np.random.Generator(np.random.PCG64(3)).random()
    moved = pytestconfig.getoption("--seed-offset") != 0
    assert (np.random.default_rng(3).random() != original) == moved


@pytest.mark.golden
def test_golden_tests_run_with_the_seeds_that_are_written():
    assert np.random.default_rng(3).random() == np.random.Generator(np.random.PCG64(3)).random()
