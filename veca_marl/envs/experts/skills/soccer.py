"""Soccer: choose the point to steer to in order to drive the ball somewhere."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.soccer import Shooter, feasible_shot, shot_at_goal, unit
from veca_marl.envs.tasks.soccer import Pitch
from veca_marl.sim.geometry import Floats

_BALL_M = 0.12
# deceleration of a rolling ball as observed, and the share of its path that a board leaves it
_ROLLING_MPS2, _REBOUND = 0.25, 0.6
_SPEED_MPS = 0.4  # of a body on hands and knees
_LEAST_PREDICTION_S, _MOST_PREDICTION_S = 0.25, 2.5


def attacking_point(shooter: Shooter, pitch: Pitch) -> Floats:
    """Return the point to steer to so that the ball moves into the goal, ``(2,)`` metres.

    Args:
        shooter: The body that shoots.
        pitch: The pitch with the ball.
    """
    ball = predicted_ball(pitch, shooter)
    return _pushing_point(shooter, pitch, ball, shot_at_goal(shooter, ball, pitch))


def clearing_point(shooter: Shooter, pitch: Pitch) -> Floats:
    """Return the point to steer to so that the ball moves away from the goal, ``(2,)`` metres.

    Arguments as of `attacking_point`.
    """
    ball = predicted_ball(pitch, shooter)
    return _pushing_point(shooter, pitch, ball, unit(ball - pitch.goal[:2]))


def predicted_ball(pitch: Pitch, shooter: Shooter) -> Floats:
    """Return where the ball will be when a body can reach it, ``(2,)`` metres.

    It decelerates uniformly and rebounds from the edges of the pitch; at most 2.5 s are predicted.
    """
    place, velocity = pitch.ball.position[:2], pitch.ball.velocity[:2]
    speed = float(np.hypot(*velocity))
    way_m = float(np.hypot(*(place - shooter.here))) - shooter.clearances.ball_m
    time_s = min(max(way_m / _SPEED_MPS, _LEAST_PREDICTION_S), _MOST_PREDICTION_S)
    time_s = min(time_s, speed / _ROLLING_MPS2)
    rolled_m = speed * time_s - _ROLLING_MPS2 * time_s**2 / 2.0
    ball = place + rolled_m * unit(velocity)
    low, high = pitch.low + _BALL_M, pitch.high - _BALL_M
    ball = ball + (1.0 + _REBOUND) * (np.maximum(low - ball, 0.0) - np.maximum(ball - high, 0.0))
    return np.clip(ball, low, high)


def _pushing_point(shooter: Shooter, pitch: Pitch, ball: Floats, shot: Floats) -> Floats:
    """Return the point to steer to so that the ball moves in a direction, ``(2,)`` metres.

    A body drives a ball in contact away from itself. The path therefore leads round the ball at a
    distance until the ball lies between the body and the aim, and then through the ball. Where
    walls leave no space for the run-up, the shot deviates from its direction as little as possible.
    """
    clearances, here = shooter.clearances, shooter.here
    shot = feasible_shot(ball, shot, clearances, pitch)
    behind, aside = float((ball - here) @ shot), abs(_cross(shot, ball - here))
    if aside < clearances.aside_m + clearances.funnel * (behind - clearances.ball_m):
        return ball - max(behind - clearances.look_ahead_m, 0.0) * shot
    start = ball - clearances.run_up_m * shot
    if shooter.keeper is not None:
        start = _around_keeper(shooter, start)
    return _around(here, ball, start, clearances.clear_m)


def _around_keeper(shooter: Shooter, goal: Floats) -> Floats:
    """Return the next point of a path to a goal past the keeper, ``(2,)`` metres."""
    keeper = shooter.keeper
    assert keeper is not None
    reach_m = min(math.dist(keeper, goal), math.dist(keeper, shooter.here)) - 0.1
    return _around(shooter.here, keeper, goal, min(shooter.clearances.other_m, reach_m))


def _around(here: Floats, obstacle: Floats, goal: Floats, clear_m: float) -> Floats:
    """Return the next point of a path to a goal that passes an obstacle, ``(2,)`` metres."""
    way = goal - here
    length = float(np.hypot(*way))
    along = unit(way)
    ahead = float((obstacle - here) @ along)
    left = np.array([-along[1], along[0]])
    aside = float((obstacle - here) @ left)
    if not (0.0 < ahead < length + 0.1 and abs(aside) < clear_m):
        return goal
    side = -math.copysign(1.0, aside)
    return obstacle + side * clear_m * 1.2 * left


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
