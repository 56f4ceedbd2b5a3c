"""Tight screen bounds of primitives, so that few rays miss the primitive they are tested with.

Screen positions are slopes: a point at (right, up, forward) metres in the camera frame has the
slopes (right / forward, up / forward). An interval with its low end above its high end is empty.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import njit

from veca_marl.sim.geometry import Vector

Interval: TypeAlias = tuple[float, float]

_EDGES_PER_AXIS = 4
# tangents beyond this angle from the optical axis (89 degrees) lie outside of every image
_GRAZING_RAD = 1.5533


@njit(cache=True, error_model="numpy")
def disc_interval(across: float, forward: float, radius: float, limit: float) -> Interval:
    """Return the slopes of the two tangents from the camera to a disc, cut to [-limit, limit].

    Args:
        across: Metres from the optical axis to the disc's centre, along one screen axis.
        forward: Metres to the disc's centre along the optical axis.
        radius: Metres.
        limit: Slope of the edge of the image.
    """
    squared = across * across + forward * forward - radius * radius
    if squared <= 0.0:
        return -limit, limit
    steep = forward * forward - radius * radius
    if forward > 0.0 and steep > 0.0:
        # the slopes s of the tangents: |across - s forward| = radius sqrt(1 + s^2)
        middle, half = across * forward, radius * math.sqrt(squared)
        return (middle - half) / steep, (middle + half) / steep
    if forward <= -radius:
        return limit, -limit
    # the disc crosses the plane of the camera: only one tangent bounds the part in front of it
    edge = _forward_tangent(abs(across), forward, radius)
    return (edge, limit) if across > 0.0 else (-limit, -edge)


@njit(cache=True, error_model="numpy")
def _forward_tangent(across: float, forward: float, radius: float) -> float:
    """Return the slope of the tangent to a disc beside the camera, on the optical axis' side."""
    angle = math.atan2(across, forward)
    angle -= math.asin(radius / math.sqrt(across * across + forward * forward))
    return math.tan(angle) if angle < _GRAZING_RAD else math.inf


@njit(cache=True, error_model="numpy")
def rod_interval(
    across: float,
    forward: float,
    axis_across: float,
    axis_forward: float,
    half_length: float,
    radius: float,
    limit: float,
) -> Interval:
    """Return bounds of the slopes of a capsule, and of the cylinder that it contains."""
    ahead = forward + half_length * axis_forward
    behind = forward - half_length * axis_forward
    if ahead * behind < 0.0:
        return -limit, limit  # the axis crosses the plane of the camera: no tangent bounds it
    one, other = across + half_length * axis_across, across - half_length * axis_across
    if one * other <= 0.0 and min(ahead, behind) <= 0.0 and max(ahead, behind) > -radius:
        # the axis passes behind the camera, from one side to the other, and the surface before it
        return -limit, limit
    low, high = disc_interval(one, ahead, radius, limit)
    other_low, other_high = disc_interval(other, behind, radius, limit)
    return min(low, other_low), max(high, other_high)


@njit(cache=True, error_model="numpy")
def box_intervals(
    centre: Vector, half: Vector, right: Vector, up: Vector, forward: Vector, near: float
) -> tuple[Interval, Interval]:
    """Return bounds of the slopes (right, up) of a box, from its edges clipped at the near plane.

    Args:
        centre: The box's centre in the camera frame: (right, up, forward) metres.
        half: Half extents along the box's own axes.
        right: The camera's right axis in the box's own axes; likewise `up` and `forward`.
        up: See `right`.
        forward: See `right`.
        near: Metres; nothing nearer is drawn.
    """
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for edge in range(3 * _EDGES_PER_AXIS):
        axis, corner = edge // _EDGES_PER_AXIS, edge % _EDGES_PER_AXIS
        one = 1.0 if corner & 1 else -1.0
        two = 1.0 if corner & 2 else -1.0
        if axis == 0:
            start, end = (
                (half[0], one * half[1], two * half[2]),
                (-half[0], one * half[1], two * half[2]),
            )
        elif axis == 1:
            start, end = (
                (one * half[0], half[1], two * half[2]),
                (one * half[0], -half[1], two * half[2]),
            )
        else:
            start, end = (
                (one * half[0], two * half[1], half[2]),
                (one * half[0], two * half[1], -half[2]),
            )
        z0 = centre[2] + _dot(start, forward)
        z1 = centre[2] + _dot(end, forward)
        if z0 < near and z1 < near:
            continue
        x0, y0 = centre[0] + _dot(start, right), centre[1] + _dot(start, up)
        x1, y1 = centre[0] + _dot(end, right), centre[1] + _dot(end, up)
        if z0 < near:
            cut = (near - z0) / (z1 - z0)
            x0, y0, z0 = x0 + cut * (x1 - x0), y0 + cut * (y1 - y0), near
        elif z1 < near:
            cut = (near - z1) / (z0 - z1)
            x1, y1, z1 = x1 + cut * (x0 - x1), y1 + cut * (y0 - y1), near
        low_x, high_x = min(low_x, x0 / z0, x1 / z1), max(high_x, x0 / z0, x1 / z1)
        low_y, high_y = min(low_y, y0 / z0, y1 / z1), max(high_y, y0 / z0, y1 / z1)
    return (low_x, high_x), (low_y, high_y)


@njit(cache=True)
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
