"""The direction of a shot at a goal: inside the mouth, free of the keeper, near for the body."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.experts.control.locomotion import Clearances
from veca_marl.envs.tasks.soccer import Pitch
from veca_marl.sim.geometry import Floats

# lateral distances of aims from the middle of the goal, as shares of its width
_AIM_SHARES = (0.0, 0.08, -0.08, 0.16, -0.16, 0.24, -0.24, 0.32, -0.32)
_OPEN_SHARE = 0.39  # where a ball that touches the inner side of a post has its centre
_DEPTH_M = 0.3  # aims are this far behind the goal line for a ball in front of the mouth
_FREE_M = 0.5  # a shot that passes the keeper at this distance is free
# costs in radians of additional turn about the ball, set by hand
_MARGIN_RAD, _MISS_COST = 0.3, 6.0  # angle to the nearer post that is wanted; cost per rad less
_KEEPER_COST, _RUN_UP_COST, _WALL_COST = 5.0, 1.0, 0.8
_DEVIATIONS_RAD = [side * math.radians(deg) for deg in range(0, 180, 15) for side in (1.0, -1.0)]


@dataclass(frozen=True)
class Shooter:
    """Positions of a body that will shoot and of an opponent.

    Attributes:
        here: Position of the body, ``(2,)`` metres.
        clearances: Distances that it needs.
        keeper: Position of an opponent, ``(2,)`` metres; None if there is none.
    """

    here: Floats
    clearances: Clearances
    keeper: Floats | None = None


def shot_at_goal(shooter: Shooter, ball: Floats, pitch: Pitch) -> Floats:
    """Return the direction in which to push a ball into the goal, a unit vector ``(2,)``.

    Of several points of the mouth it is the one with the least sum of costs: the turn of the body
    about the ball, a small angle to a post, a keeper near the path of the ball or near the run-up,
    and walls that leave no space for the run-up.

    Args:
        shooter: The body.
        ball: Position of the ball, ``(2,)`` metres.
        pitch: The pitch.
    """
    half_m = pitch.goal_width_m / 2.0
    is_in_front = abs(float(ball[1] - pitch.goal[1])) < half_m
    depth_m = _DEPTH_M if is_in_front else 0.0
    aims = (np.array([depth_m, share * pitch.goal_width_m]) for share in _AIM_SHARES)
    shots = [unit(pitch.goal[:2] + aim - ball) for aim in aims]
    return min(shots, key=lambda shot: _cost(shot, shooter, ball, pitch))


def feasible_shot(ball: Floats, shot: Floats, clearances: Clearances, pitch: Pitch) -> Floats:
    """Return the direction nearest to a shot's for which the pitch has space for the run-up."""
    for deviation_rad in _DEVIATIONS_RAD:
        c, s = math.cos(deviation_rad), math.sin(deviation_rad)
        rotated = np.array([c * shot[0] - s * shot[1], s * shot[0] + c * shot[1]])
        if _has_run_up(ball, rotated, clearances, pitch):
            return rotated
    return shot


def segment_distance_m(start: Floats, end: Floats, point: Floats) -> float:
    """Return the distance of a point from a line segment, metres."""
    way = end - start
    share = float((point - start) @ way) / max(float(way @ way), 1e-9)
    return float(np.hypot(*(start + min(max(share, 0.0), 1.0) * way - point)))


def unit(way: Floats) -> Floats:
    """Return a vector of length 1 with the same direction."""
    return way / max(float(np.hypot(*way)), 1e-9)


def _cost(shot: Floats, shooter: Shooter, ball: Floats, pitch: Pitch) -> float:
    clearances = shooter.clearances
    turn_rad = _angle_rad(ball - shooter.here, shot)
    cost = turn_rad + _MISS_COST * max(_MARGIN_RAD - _post_margin_rad(shot, ball, pitch), 0.0)
    if not _has_run_up(ball, shot, clearances, pitch):
        cost += _WALL_COST
    if shooter.keeper is None:
        return cost
    end = ball + max(float(pitch.goal[0] - ball[0]), 0.0) / max(float(shot[0]), 0.1) * shot
    from_path_m = segment_distance_m(ball, end, shooter.keeper)
    start = ball - clearances.run_up_m * shot
    is_in_the_way = segment_distance_m(start, ball, shooter.keeper) < clearances.other_m
    blocked = max(1.0 - from_path_m / _FREE_M, 0.0)
    return cost + _KEEPER_COST * blocked + _RUN_UP_COST * float(is_in_the_way)


def _post_margin_rad(shot: Floats, ball: Floats, pitch: Pitch) -> float:
    """Return the angle between a shot and the direction of the nearer post."""
    open_m = _OPEN_SHARE * pitch.goal_width_m
    posts = (pitch.goal[:2] + np.array([0.0, side * open_m]) - ball for side in (1.0, -1.0))
    return min(_angle_rad(shot, post) for post in posts)


def _has_run_up(ball: Floats, shot: Floats, clearances: Clearances, pitch: Pitch) -> bool:
    start, margin = ball - clearances.run_up_m * shot, clearances.wall_m
    return bool((start > pitch.low + margin).all() and (start < pitch.high - margin).all())


def _angle_rad(a: Floats, b: Floats) -> float:
    return abs(math.atan2(float(a[0] * b[1] - a[1] * b[0]), float(a @ b)))
