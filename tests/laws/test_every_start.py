"""The starts of every task: inside the rooms, and those of its frozen episodes."""

import numpy as np
import pytest
from rollouts import game_cfg

from veca_marl.envs.core.benchmark import EPISODES, find_benchmark, parameters, start_values
from veca_marl.envs.core.episodes import Episodes

NUMBERS = (0, 57, 99)


# a start that fails in 1 of 100 episodes would stop a run within minutes
@pytest.mark.parametrize("seeds", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_every_seed_has_a_start_inside_the_rooms(own_game, seeds):
    rooms = own_game.world.playground.rooms
    for seed in range(seeds):
        own_game.task.reset(np.random.default_rng(seed))
        for player in own_game.players:
            x, y = player.body.position[:2]
            assert min(room.distance_m((x, y)) for room in rooms) == 0.0, seed


@pytest.mark.golden
def test_frozen_starts_are_those_of_the_task(task, own_game):
    """The stored ones were written by another process."""
    stored, cfg = find_benchmark(task), game_cfg(task)
    assert stored.task == task
    assert stored.parameters == parameters(cfg.task), "run python -m tools.make_benchmark"
    for number in NUMBERS:
        rng = Episodes(stored.seed, number).next()
        own_game.reset(rng)
        stored.check_starts([start_values(own_game, rng)], first=number)


def test_frozen_starts_differ(task):
    stored = find_benchmark(task)
    assert len(stored.starts) == len({repr(start) for start in stored.starts}) == EPISODES
