"""The frozen episodes of every task have the starts of the present code."""

from rollouts import game_cfg

from veca_marl.envs.core.benchmark import EPISODES, find_benchmark, parameters, start_digests

NUMBERS = (0, 57, 99)


def test_frozen_starts_are_those_of_the_task(task):
    stored, cfg = find_benchmark(task), game_cfg(task)
    assert stored.task == task
    assert stored.parameters == parameters(cfg.task), "run scripts/make_benchmark.py"
    found = start_digests(cfg, stored.seed, NUMBERS)
    assert found == [stored.starts[n] for n in NUMBERS], "run scripts/make_benchmark.py"


def test_frozen_starts_differ(task):
    stored = find_benchmark(task)
    assert len(stored.starts) == len(set(stored.starts)) == EPISODES
