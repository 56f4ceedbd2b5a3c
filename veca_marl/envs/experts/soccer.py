"""Soccer on two legs: get behind the ball and kick it at the goal; stand in its way."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.walking import walk_to
from veca_marl.sim.bodies.walker import Walker
from veca_marl.sim.pose import Floats
from veca_marl.sim.props import Prop

_RUN_UP_M = 0.45  # from the ball, before a shot
_CLEAR_M = 0.42  # passing the ball at this distance, the foot does not reach it
_AHEAD_S = 0.25  # the ball is taken where it will be then
_IN_LINE = 0.97  # cosine of the angle at the ball between run-up and shot


def attack(body: Walker, ball: Prop, aim: Floats) -> tuple[float, float]:
    """Return the wish (forward, turn) of who wants the ball to go to a point.

    A foot kicks whatever comes into its reach, away from the body: so go round the ball at a
    distance until it lies between the body and the aim, then walk at it.

    Args:
        body: Who attacks.
        ball: What.
        aim: ``(2,)`` or ``(3,)`` metres: where it shall go.
    """
    place = ball.position[:2] + _AHEAD_S * ball.velocity[:2]
    shot, way = _unit(aim[:2] - place), place - body.position[:2]
    if _unit(way) @ shot > _IN_LINE:
        return walk_to(body, place)
    return walk_to(body, _round(body.position[:2], place, place - _RUN_UP_M * shot))


def _round(here: Floats, ball: Floats, there: Floats) -> Floats:
    """Return where to go first on the way to a point beside the ball without touching it."""
    way = there - here
    length = float(np.hypot(*way))
    along = _unit(way)
    ahead = float((ball - here) @ along)
    left = np.array([-along[1], along[0]])
    aside = float((ball - here) @ left)
    if not (0.0 < ahead < length + 0.1 and abs(aside) < _CLEAR_M):
        return there
    side = -math.copysign(1.0, aside)
    return ball + side * _CLEAR_M * 1.2 * left


def _unit(way: Floats) -> Floats:
    return way / max(float(np.hypot(*way)), 1e-9)
