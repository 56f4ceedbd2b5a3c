"""HandRegard: hands within 15 degrees of the axes of the eyes."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.config import ConfigError
from veca_marl.config import compose as compose_anew
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.tasks.hand_regard import PAIRS, regard_rad
from veca_marl.sim.geometry import Pose


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=HandRegard", "task.max_seconds=4.0"]).game)
    yield game
    game.close()


class Looking:
    """A body with one eye at the origin, which looks along x, and one hand."""

    def __init__(self, hand):
        self._hand = hand

    def mount(self, name):
        return Pose(np.zeros(3), np.eye(3))

    def bone(self, name):
        return Pose(np.array(self._hand, float), np.eye(3))


@pytest.mark.parametrize(
    ("hand", "degrees"),
    [((0.3, 0, 0), 0), ((0.2, 0.2, 0), 45), ((0, 0, -0.1), 90), ((-1, 0, 0), 180)],
)
def test_the_angle_between_the_axis_of_the_eye_and_the_hand(hand, degrees):
    assert math.degrees(regard_rad(Looking(hand), "eye_left", "l_hand")) == pytest.approx(degrees)


def test_hands_beside_the_body_are_not_regarded(game):
    game.reset(np.random.default_rng(0))
    assert set(game.task.reward(game.players[0]).values()) == {0.0}


def test_the_expert_brings_both_hands_before_both_eyes(game):
    """And the sum of a term over an episode is the share of its steps."""
    game.reset(np.random.default_rng(0))
    sums = dict.fromkeys(game.weights, 0.0)
    for _ in range(100):
        game.play_script(game.actors[0], Script.expert)
        for term, value in game.advance().terms["agents"].items():
            assert value in (0.0, 0.01)
            sums[term] += value
    assert min(sums.values()) > 0.2
    assert sum(sums.values()) / 4 > 0.35
    assert len(PAIRS) == 4


def test_the_angle_must_be_possible():
    with pytest.raises(ConfigError, match="half_angle_deg=90"):
        compose_anew(["+task=HandRegard", "task.half_angle_deg=90"])
