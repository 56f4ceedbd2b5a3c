"""Motion of both palms of a sitting body."""

import numpy as np
import pytest
from blocks import blocks_game

from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion

SIDE = Grip(np.array([0.25, 0.06, 0.16]), 0.1)


@pytest.fixture(scope="module")
def game():
    game = blocks_game("PutDownBlock")
    yield game
    game.close()


def middles(game, steps):
    """Return the middle between the palms, which move to one side and stay there, (steps, 3)."""
    game.reset(np.random.default_rng(0))
    for index, block in enumerate((*game.task.blue, game.task.red)):
        block.place((1.5, 1.5 + 0.2 * index, 0.03))
    player = game.players[0]
    palms = PalmMotion(player.body, game.world.clock.step_s, posture_gain_per_s=0.25)
    path = []
    for _ in range(steps):
        game.step({player.name: player.body.encode(palms.move(SIDE))})
        path.append(palms.middle)
    return np.array(path)


def test_palms_on_one_side_stay_at_their_place(game):
    """Arms that follow the twist of the trunk without a filter sway by 20 mm to either side."""
    path = middles(game, 75)[40:]
    assert path[:, 1].std() < 0.006
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).mean() < 0.004
    np.testing.assert_allclose(path.mean(axis=0), SIDE.centre, atol=0.015)
