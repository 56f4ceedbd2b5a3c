"""Soccer: choose the point to steer to in order to drive the ball somewhere."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.control.locomotion import Clearances
from veca_marl.envs.tasks.contests.pitch import Pitch
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats

_PREDICTION_S = 0.25  # the ball's position is extrapolated by this time
_BALL_M = 0.12
_DEVIATIONS_RAD = [side * math.radians(deg) for deg in range(0, 180, 15) for side in (1.0, -1.0)]
_GOAL_LINE_SHARES = (0.0, 0.12, -0.12, 0.24, -0.24, 0.33, -0.33)  # of the goal's width
_FREE_M = 0.45  # a path that passes the keeper at this distance counts as free


def shooting_goal(body: Body, clearances: Clearances, pitch: Pitch, aim: Floats) -> Floats:
    """Return the point to steer to so that the ball moves to an aim, ``(2,)`` metres.

    A body drives a ball in contact away from itself. The path therefore leads round the ball at a
    distance until the ball lies between the body and the aim, and then through the ball. Where
    walls leave no space for the run-up, the shot deviates from the aim as little as possible.

    Args:
        body: The body that shoots.
        clearances: Distances that it needs.
        pitch: The pitch with the ball.
        aim: Where the ball should go, ``(2,)`` or ``(3,)`` metres.
    """
    ball = np.clip(
        pitch.ball.position[:2] + _PREDICTION_S * pitch.ball.velocity[:2],
        pitch.low + _BALL_M,
        pitch.high - _BALL_M,
    )
    here = body.position[:2]
    shot = _feasible_shot(ball, _unit(aim[:2] - ball), clearances, pitch)
    behind, aside = float((ball - here) @ shot), abs(_cross(shot, ball - here))
    if aside < clearances.aside_m + clearances.funnel * (behind - clearances.ball_m):
        return ball - max(behind - clearances.look_ahead_m, 0.0) * shot
    return _around_ball(here, ball, ball - clearances.run_up_m * shot, clearances.clear_m)


def open_corner(pitch: Pitch, keeper: Floats) -> Floats:
    """Return the point of the goal line with the path from the ball that is farthest from a keeper.

    Args:
        pitch: The pitch with the ball.
        keeper: Position of the keeper, ``(2,)`` or ``(3,)`` metres.

    Returns:
        ``(2,)`` metres. Distances above 0.45 m count as equal; the middle is preferred.
    """
    goal, ball = pitch.goal[:2], pitch.ball.position[:2]
    spots = [goal + np.array([0.0, share * pitch.goal_width_m]) for share in _GOAL_LINE_SHARES]
    return max(spots, key=lambda spot: min(_segment_distance_m(ball, spot, keeper[:2]), _FREE_M))


def _segment_distance_m(start: Floats, end: Floats, point: Floats) -> float:
    """Return the distance of a point from a line segment, metres."""
    way = end - start
    share = float((point - start) @ way) / max(float(way @ way), 1e-9)
    return float(np.hypot(*(start + min(max(share, 0.0), 1.0) * way - point)))


def _feasible_shot(ball: Floats, shot: Floats, clearances: Clearances, pitch: Pitch) -> Floats:
    """Return the direction nearest to a shot's for which the pitch has space for the run-up."""
    margin = clearances.wall_m
    for deviation_rad in _DEVIATIONS_RAD:
        c, s = math.cos(deviation_rad), math.sin(deviation_rad)
        rotated = np.array([c * shot[0] - s * shot[1], s * shot[0] + c * shot[1]])
        start = ball - clearances.run_up_m * rotated
        if (start > pitch.low + margin).all() and (start < pitch.high - margin).all():
            return rotated
    return shot


def _around_ball(here: Floats, ball: Floats, goal: Floats, clear_m: float) -> Floats:
    """Return the next point of a path to a goal that does not touch the ball, ``(2,)`` metres."""
    way = goal - here
    length = float(np.hypot(*way))
    along = _unit(way)
    ahead = float((ball - here) @ along)
    left = np.array([-along[1], along[0]])
    aside = float((ball - here) @ left)
    if not (0.0 < ahead < length + 0.1 and abs(aside) < clear_m):
        return goal
    side = -math.copysign(1.0, aside)
    return ball + side * clear_m * 1.2 * left


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _unit(way: Floats) -> Floats:
    return way / max(float(np.hypot(*way)), 1e-9)
