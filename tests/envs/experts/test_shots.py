"""Directions of shots at a goal."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from veca_marl.envs.experts.control.locomotion import CrawlLocomotion
from veca_marl.envs.experts.soccer import Shooter, feasible_shot, shot_at_goal

PITCH = SimpleNamespace(
    low=np.array([-3.0, -3.0]),
    high=np.array([2.5, 3.0]),
    goal=np.array([2.5, 0.0, 0.0]),
    goal_width_m=1.4,
)
CLEARANCES = CrawlLocomotion.clearances


def shot(here, ball, keeper=None):
    keeper = None if keeper is None else np.array(keeper)
    return shot_at_goal(Shooter(np.array(here), CLEARANCES, keeper), np.array(ball), PITCH)


def crossing_m(ball, direction):
    """Return where on the goal line a ball arrives, metres to the left of the middle."""
    return ball[1] + (2.5 - ball[0]) * direction[1] / direction[0]


def test_a_distant_ball_is_shot_at_the_middle():
    assert abs(crossing_m((0.0, 0.5), shot((-1.0, 0.6), (0.0, 0.5)))) < 0.1


@pytest.mark.parametrize("aside_m", [-0.5, 0.0, 0.5])
def test_a_ball_in_the_mouth_is_shot_straight(aside_m):
    ball = (2.4, aside_m)
    direction = shot((1.5, aside_m), ball)
    assert direction[0] > math.cos(math.radians(25.0))
    assert abs(crossing_m(ball, direction)) < 0.55


def test_a_shot_passes_the_keeper():
    ball, keeper = (0.0, 0.0), (2.0, 0.0)
    direction = shot((-1.0, 0.0), ball, keeper)
    assert abs(direction[0] * keeper[1] - direction[1] * keeper[0]) > 0.3
    assert abs(crossing_m(ball, direction)) < 0.5


def test_of_two_corners_the_nearer_one_for_the_body_is_chosen():
    ball, keeper = (1.0, 0.0), (2.0, 0.0)
    assert shot((0.0, -0.4), ball, keeper)[1] > 0.0
    assert shot((0.0, 0.4), ball, keeper)[1] < 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_ball_at_the_board_beside_the_goal_is_pushed_along_it(side):
    ball = np.array([2.35, side * 1.2])
    direction = feasible_shot(ball, shot((1.5, side * 1.5), ball), CLEARANCES, PITCH)
    assert -side * direction[1] > 0.8
    assert direction[0] > 0.0
    start = ball - CLEARANCES.run_up_m * direction
    assert start[0] < 2.5 - CLEARANCES.wall_m
