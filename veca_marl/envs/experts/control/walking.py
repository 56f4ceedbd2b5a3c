"""Walking to a point of the floor: what the experts on walking bodies have in common."""

from __future__ import annotations

import math

from veca_marl.sim.body.base import Body
from veca_marl.sim.geometry.pose import Floats

_FULL_TURN_RAD = 0.25  # to the side of the way: worth a full turn


def bearing_rad(body: Body, point: Floats) -> float:
    """Return how far to the left of straight ahead a point of the floor plan is, in [-pi, pi]."""
    way, ahead = point[:2] - body.position[:2], body.forward
    return math.atan2(ahead[0] * way[1] - ahead[1] * way[0], float(ahead[:2] @ way))


def walk_to(body: Body, point: Floats, speed: float = 1.0) -> tuple[float, float]:
    """Return the wish (forward, turn) that leads to a point: turn to it, walk where it is ahead.

    Args:
        body: Who walks.
        point: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
        speed: Share of the full speed.
    """
    aside = bearing_rad(body, point)
    turn = min(max(aside / _FULL_TURN_RAD, -1.0), 1.0)
    return speed * max(0.0, math.cos(aside)), turn
