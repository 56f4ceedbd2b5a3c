"""Steering of walkers to points of the floor."""

from __future__ import annotations

import math

from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats

_FULL_TURN_RAD = 0.25  # bearing at which the turning command saturates


def bearing_rad(body: Body, point: Floats) -> float:
    """Return the angle of a point to the left of a body's forward direction, in [-pi, pi].

    Args:
        body: The body.
        point: ``(2,)`` or ``(3,)`` metres; the height is ignored.
    """
    way, ahead = point[:2] - body.position[:2], body.forward
    return math.atan2(ahead[0] * way[1] - ahead[1] * way[0], float(ahead[:2] @ way))


def walk_to(body: Body, point: Floats, speed: float = 1.0) -> tuple[float, float]:
    """Return the command (forward, turn) of a walker that moves to a point.

    It turns towards the point and walks with the cosine of the bearing, if that is positive.

    Args:
        body: The body of the walker.
        point: ``(2,)`` or ``(3,)`` metres; the height is ignored.
        speed: Share of the greatest speed.
    """
    bearing = bearing_rad(body, point)
    turn = min(max(bearing / _FULL_TURN_RAD, -1.0), 1.0)
    return speed * max(0.0, math.cos(bearing)), turn
