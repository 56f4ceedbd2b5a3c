"""Wrestling on two legs: get between the other one and the middle of the ring, and push."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.walking import walk_to
from veca_marl.sim.bodies.base import Body
from veca_marl.sim.bodies.walker import Walker
from veca_marl.sim.pose import Floats

_ROUND_RAD = 1.0
_FACED_RAD = 0.8


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
    way, inward = there - here, middle - here
    distance = float(np.hypot(*way))
    left = np.array([-way[1], way[0]])
    outward = _cosine(way, there - middle)
    faced = _cosine(other.forward[:2], -way)
    round_rad = _ROUND_RAD * (1.0 - outward) / 2.0 + _FACED_RAD * max(faced, 0.0) * (distance < 0.3)
    side = math.copysign(1.0, float(left @ inward))
    c, s = math.cos(side * round_rad), math.sin(side * round_rad)
    return walk_to(body, here + np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]]))


def _cosine(a: Floats, b: Floats) -> float:
    return float(a @ b) / max(float(np.hypot(*a) * np.hypot(*b)), 1e-9)
