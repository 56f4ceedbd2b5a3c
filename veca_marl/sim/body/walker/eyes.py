"""Eyes of a walker stay within its capsule: what stops the capsule is never behind an eye."""

from __future__ import annotations

import math

from veca_marl.sim.body.walker.walker_collisions import Footprint
from veca_marl.sim.geometry import Floats, Pose

CLEARANCE_M = 0.005
"""Least distance of an eye from the surface of the capsule on the floor plan."""


def kept_inside(eye: Pose, to_other_m: float, centre: Floats, footprint: Footprint) -> Pose:
    """Return the pose of an eye, moved back on the floor plan if it is too far out.

    A head that is bent forward reaches out of a capsule. Both eyes are moved alike, so that their
    distance from each other stays what it is.

    Args:
        eye: Pose of the eye, with the axes of the head.
        to_other_m: See `other_eye_m`.
        centre: ``(2,)`` metres, position of the capsule on the floor plan.
        footprint: The capsule there.
    """
    limit = max(footprint.radius_m - CLEARANCE_M, 0.0)
    # numbers are faster than arrays: this is read several times in each step
    x, y = float(eye.position[0] - centre[0]), float(eye.position[1] - centre[1])
    left_x, left_y = float(eye.rotation[0, 1]), float(eye.rotation[1, 1])
    other_x, other_y = x + to_other_m * left_x, y + to_other_m * left_y
    if max(x * x + y * y, other_x * other_x + other_y * other_y) <= limit * limit:
        return eye
    both = [_from_axis(*place, footprint) for place in ((x, y), (other_x, other_y))]
    if max(math.hypot(*place) for place in both) <= limit:
        return eye
    middle_x, middle_y = (sum(each) / 2.0 for each in zip(*both, strict=True))
    length = math.hypot(middle_x, middle_y)
    out_x, out_y = middle_x / length, middle_y / length
    shift = max(_excess(x * out_x + y * out_y, math.hypot(x, y), limit) for x, y in both)
    return Pose(eye.position - (shift * out_x, shift * out_y, 0.0), eye.rotation)


def _from_axis(x: float, y: float, footprint: Footprint) -> tuple[float, float]:
    """Return the way from the nearest point of the axis of a capsule to a point, on the plan.

    Args:
        x: Way from the centre of the capsule to the point, metres.
        y: Likewise.
        footprint: The capsule.
    """
    axis_x, axis_y = footprint.half_axis_m
    square = axis_x * axis_x + axis_y * axis_y
    if square == 0.0:
        return x, y
    along = min(max((x * axis_x + y * axis_y) / square, -1.0), 1.0)
    return x - along * axis_x, y - along * axis_y


def _excess(out: float, distance: float, limit: float) -> float:
    """Return by how much a point has to move inwards until it is at a limit from the axis.

    Args:
        out: Its distance from the axis along the direction of the motion, metres.
        distance: Its distance from the axis.
        limit: The greatest one.
    """
    aside_square = max(distance * distance - out * out, 0.0)
    return out - math.sqrt(max(limit * limit - aside_square, 0.0))
