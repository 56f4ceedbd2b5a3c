"""Wrestling on two legs: get between the other one and the middle of the ring, and push."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.walking import walk_to
from veca_marl.sim.bodies.base import Body
from veca_marl.sim.bodies.walker import Walker
from veca_marl.sim.pose import Floats

_ROUND_RAD = 1.0  # aside of the other one, for one who is pushed inwards; less the more outwards
_FACED_RAD = 0.8  # and more, for one who pushes back
_TOUCH_M = 0.3  # between the axes of two who push each other
_KEEP_SHARE = 0.85  # of the radius: who touches nobody goes no farther out


def wrestle(body: Walker, other: Body, middle: Floats, radius_m: float) -> tuple[float, float]:
    """Return the wish (forward, turn) of who wants to push another out of a ring.

    Face to face two walkers hold each other, so the way goes round the other one, on the side of
    the middle of the ring: who is pushed from there goes outwards.

    Args:
        body: Who pushes.
        other: Who shall be pushed.
        middle: ``(2,)`` metres: of the ring.
        radius_m: Of the ring.
    """
    here, there = body.position[:2], other.position[:2]
    way = there - here
    touches = float(np.hypot(*way)) < _TOUCH_M
    outwards = _cosine(way, there - middle)
    held = max(_cosine(other.forward[:2], -way), 0.0) if touches else 0.0
    round_rad = _ROUND_RAD * (1.0 - outwards) / 2.0 + _FACED_RAD * held
    goal = here + _turned(way, math.copysign(round_rad, _cross(way, middle - here)))
    return walk_to(body, goal if touches else _inside(goal, middle, _KEEP_SHARE * radius_m))


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
