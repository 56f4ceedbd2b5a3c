"""Walking to a point of the floor: what the experts on walking bodies have in common."""

from __future__ import annotations

import math

from veca_marl.sim.bodies.walker import Walker
from veca_marl.sim.pose import Floats

_FULL_TURN_RAD = 0.25  # to the side of the way: worth a full turn


def bearing_rad(body: Walker, point: Floats) -> float:
    """Return how far to the left of straight ahead a point of the floor plan is, in [-pi, pi]."""
    way = point[:2] - body.position[:2]
    ahead = math.atan2(way[1], way[0]) - body.yaw_rad
    return (ahead + math.pi) % (2.0 * math.pi) - math.pi


def walk_to(body: Walker, point: Floats, speed: float = 1.0) -> tuple[float, float]:
    """Return the wish (forward, turn) that leads to a point: turn to it, walk where it is ahead.

    Args:
        body: Who walks.
        point: ``(2,)`` or ``(3,)`` metres; only the horizontal part counts.
        speed: Share of the full speed.
    """
    aside = bearing_rad(body, point)
    turn = min(max(aside / _FULL_TURN_RAD, -1.0), 1.0)
    return speed * max(0.0, math.cos(aside)), turn
