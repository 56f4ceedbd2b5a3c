"""Wrestling: get between the other one and the middle of the ring, and push."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.control.legs import Reach
from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry.pose import Floats

_ROUND_RAD = 1.0  # aside of the other one, for one who is pushed inwards; less the more outwards
_FACED_RAD = 0.8  # and more, for one who pushes back


def wrestle(body: Body, reach: Reach, other: Body, middle: Floats, radius_m: float) -> Floats:
    """Return where to go, ``(2,)`` metres, for who wants to push another out of a ring.

    Face to face two hold each other, so the way goes round the other one, on the side of
    the middle of the ring: who is pushed from there goes outwards. Who touches nobody, or is
    farther out than the other one, keeps off the rope, by as much as it takes to turn round.

    Args:
        body: Who pushes.
        reach: How near it comes to things.
        other: Who shall be pushed.
        middle: ``(2,)`` metres: of the ring.
        radius_m: Of the ring.
    """
    here, there = body.position[:2], other.position[:2]
    way = there - here
    touches = float(np.hypot(*way)) < reach.other_m
    outwards = _cosine(way, there - middle)
    held = max(_cosine(other.forward[:2], -way), 0.0) if touches else 0.0
    round_rad = _ROUND_RAD * (1.0 - outwards) / 2.0 + _FACED_RAD * held
    goal = here + _turned(way, math.copysign(round_rad, _cross(way, middle - here)))
    here_m, there_m = (float(np.hypot(*(place - middle))) for place in (here, there))
    if touches and here_m < there_m - reach.other_m / 4.0 and _cosine(body.forward[:2], way) > 0.5:
        return goal
    if here_m > radius_m - 2.0 * reach.turning_m:
        return middle
    return _inside(goal, middle, radius_m - reach.other_m)


def _inside(place: Floats, middle: Floats, radius_m: float) -> Floats:
    """Return the nearest place of a disc."""
    way = place - middle
    return middle + way * min(radius_m / max(float(np.hypot(*way)), 1e-9), 1.0)


def _turned(way: Floats, angle_rad: float) -> Floats:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])


def _cosine(a: Floats, b: Floats) -> float:
    return float(a @ b) / max(float(np.hypot(*a) * np.hypot(*b)), 1e-9)


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
