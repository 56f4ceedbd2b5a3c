"""Help for the tests of the tasks of moving oneself."""

import numpy as np

from veca_marl.config import compose
from veca_marl.envs.game import Game


def baby_game(task, *overrides):
    """Return a game at its first start; without touch, which these tests do not ask for."""
    game = Game(compose([f"+task={task}", "senses/touch=numb", *overrides]).game)
    game.reset(np.random.default_rng(0))
    return game
