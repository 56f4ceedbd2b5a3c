"""Soccer: get behind the ball and drive it at the goal; stand in its way."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.control.legs import Reach
from veca_marl.envs.tasks.multi_agent.pitch import Pitch
from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry.pose import Floats

_AHEAD_S = 0.25  # the ball is taken where it will be then
_BALL_M = 0.12
_ASIDE_RAD = [side * math.radians(deg) for deg in range(0, 180, 15) for side in (1.0, -1.0)]
_CORNERS = (0.0, 0.12, -0.12, 0.24, -0.24, 0.33, -0.33)  # shares of the goal's width
_FREE_M = 0.45  # farther from a keeper no shot is freer


def attack(body: Body, reach: Reach, pitch: Pitch, aim: Floats) -> Floats:
    """Return where to go, ``(2,)`` metres, for who wants the ball to go to a point.

    A body drives whatever comes into its reach away from itself: so go round the ball at a
    distance until it lies between the body and the aim, then go at it. Where walls leave no room
    for the run-up, the shot goes as near to the aim as it can.

    Args:
        body: Who attacks.
        reach: How near it comes to things.
        pitch: Where, with what ball.
        aim: ``(2,)`` or ``(3,)`` metres: where it shall go.
    """
    ball = np.clip(
        pitch.ball.position[:2] + _AHEAD_S * pitch.ball.velocity[:2],
        pitch.low + _BALL_M,
        pitch.high - _BALL_M,
    )
    here, shot = body.position[:2], _possible(ball, _unit(aim[:2] - ball), reach, pitch)
    behind, aside = (ball - here) @ shot, abs(_cross(shot, ball - here))
    if aside < reach.aside_m + reach.funnel * (behind - reach.ball_m):
        return ball - max(behind - reach.look_ahead_m, 0.0) * shot
    return _round(here, ball, ball - reach.run_up_m * shot, reach.clear_m)


def open_corner(pitch: Pitch, keeper: Floats) -> Floats:
    """Return the point of the goal line to aim at, ``(2,)`` metres: past a keeper.

    Args:
        pitch: Where.
        keeper: ``(2,)`` or ``(3,)`` metres: who stands in the way.
    """
    goal, ball = pitch.goal[:2], pitch.ball.position[:2]
    spots = [goal + np.array([0.0, share * pitch.goal_width_m]) for share in _CORNERS]
    return max(spots, key=lambda spot: min(_gap_m(ball, spot, keeper[:2]), _FREE_M))


def _gap_m(start: Floats, end: Floats, other: Floats) -> float:
    """Return how far a straight way passes another one, metres."""
    way = end - start
    share = float((other - start) @ way) / max(float(way @ way), 1e-9)
    return float(np.hypot(*(start + min(max(share, 0.0), 1.0) * way - other)))


def _possible(ball: Floats, shot: Floats, reach: Reach, pitch: Pitch) -> Floats:
    """Return the direction nearest to a shot's for which the pitch has room for the run-up."""
    for aside_rad in _ASIDE_RAD:
        c, s = math.cos(aside_rad), math.sin(aside_rad)
        turned = np.array([c * shot[0] - s * shot[1], s * shot[0] + c * shot[1]])
        start = ball - reach.run_up_m * turned
        if (start > pitch.low + reach.wall_m).all() and (start < pitch.high - reach.wall_m).all():
            return turned
    return shot


def _round(here: Floats, ball: Floats, there: Floats, clear_m: float) -> Floats:
    """Return where to go first on the way to a point beside the ball without touching it."""
    way = there - here
    length = float(np.hypot(*way))
    along = _unit(way)
    ahead = float((ball - here) @ along)
    left = np.array([-along[1], along[0]])
    aside = float((ball - here) @ left)
    if not (0.0 < ahead < length + 0.1 and abs(aside) < clear_m):
        return there
    side = -math.copysign(1.0, aside)
    return ball + side * clear_m * 1.2 * left


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _unit(way: Floats) -> Floats:
    return way / max(float(np.hypot(*way)), 1e-9)
