"""A sweep starts no more runs at a time than their replay buffers fit into memory."""

import sys
from importlib import import_module

import pytest

from veca_marl.algos import storage
from veca_marl.config import compose
from veca_marl.sweeps.memory import memory_of_run, runs_that_fit

SMALL = ("+task=KickTheBall", "senses/vision=blind")
TRAIN = import_module("veca_marl.train")


@pytest.mark.parametrize(
    ("available", "runs"), [(100, 4), (80, 3), (56, 2), (44, 1), (10, 1), (None, 4)]
)
def test_the_largest_runs_fit_together_into_nine_tenths_of_the_memory(available, runs):
    assert runs_that_fit([10, 20, 30, 20], available) == runs


def test_the_memory_of_a_run_is_that_of_its_replay_buffers():
    one, two = (
        memory_of_run(compose([*SMALL, "algo=sac", f"algo.replay.capacity={capacity}"]))
        for capacity in (10_000, 20_000)
    )
    assert two == 2 * one > 0
    assert memory_of_run(compose(SMALL)) == 0


@pytest.mark.parametrize(("algo", "runs"), [("sac", 2), ("mappo", 4)])
def test_runs_at_a_time_fit_into_the_memory(algo, runs, tmp_path, monkeypatch):
    needed = memory_of_run(compose([*SMALL, "algo=sac"]))
    plugin = sys.modules["hydra_plugins.veca_marl_sweeps"]
    seen = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plugin, "usable_cores", lambda: 4)
    monkeypatch.setattr(plugin, "run_sweep", lambda jobs, at_once, threads: seen.append(at_once))
    monkeypatch.setattr(storage, "available_memory", lambda: int(2.5 * needed / 0.9))
    words = ["-m", *SMALL, f"algo={algo}", "collect.processes=0", "threads=1", "seed=0,1,2,3,4"]
    monkeypatch.setattr(sys, "argv", ["train", *words])
    TRAIN.prepare(words)
    TRAIN.main()
    assert seen == [runs]
