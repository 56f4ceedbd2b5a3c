"""Games of one task that have begun, for tests of tasks."""

import numpy as np
from composed import compose

from veca_marl.envs.core.game import Game


def game_of(task, *overrides):
    """Return a game of a task with its presets, in the episode of seed 0."""
    game = Game(compose([f"+task={task}", *overrides]).game)
    game.reset(np.random.default_rng(0))
    return game
