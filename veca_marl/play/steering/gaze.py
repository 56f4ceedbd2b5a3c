"""The gaze of a body, steered by the position of the pointer in the window."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body import Body
from veca_marl.sim.geometry import Floats

YAW_RAD, PITCH_RAD = math.radians(45.0), math.radians(35.0)
DISTANCE_M = 3.0


def gaze_point(body: Body, right: float, down: float) -> Floats:
    """Return the point to look at, ``(3,)`` metres in the world frame, 3 m from the head.

    Args:
        body: The body; the direction is relative to its head.
        right: -1 is 45 degrees to the left of straight ahead, 1 to the right.
        down: -1 is 35 degrees above straight ahead, 1 below.
    """
    yaw, pitch = -right * YAW_RAD, -down * PITCH_RAD
    direction = (
        math.cos(pitch) * math.cos(yaw),
        math.cos(pitch) * math.sin(yaw),
        math.sin(pitch),
    )
    head = body.mount("head")
    point: Floats = head.position + DISTANCE_M * (head.rotation @ np.array(direction))
    return point
