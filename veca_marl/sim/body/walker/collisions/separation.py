"""Separation of overlapping walkers on the floor plan.

A walker is a disc when it stands, and a stadium along its heading when it crawls: all places within
a radius of an axis, which for a disc is a point.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from veca_marl.sim.geometry import Floats

_TOLERANCE_M = 1e-7


class Footprint(NamedTuple):
    """A walker on the floor plan, about its position.

    Attributes:
        radius_m: Radius about its axis.
        half_axis_m: From its position to an end of the axis, ``(x, y)``; ``(0, 0)`` for a disc.
    """

    radius_m: float
    half_axis_m: tuple[float, float]


@njit(cache=True)
def separate(positions: Floats, half_axes: Floats, radii: Floats, corrections: Floats) -> bool:
    """Write the displacements that separate all overlapping pairs.

    Each one of a pair moves by half of the overlap, divided by the larger number of overlaps that
    one of the two has: a damped Jacobi iteration, in which none moves by more than its deepest
    overlap. Nothing is turned.

    Args:
        positions: ``(n, 2)`` metres on the floor plan.
        half_axes: ``(n, 2)`` metres, see `Footprint`.
        radii: ``(n,)`` metres.
        corrections: ``(n, 2)`` metres; overwritten.

    Returns:
        Whether any two overlap.
    """
    n = len(positions)
    corrections[:] = 0.0
    counts = _overlap_counts(positions, half_axes, radii)
    for i in range(n):
        for j in range(i):
            dx, dy, distance, overlap = _overlap(positions, half_axes, radii, i, j)
            if overlap <= _TOLERANCE_M:
                continue
            share = 0.5 * overlap / (distance * max(counts[i], counts[j]))
            corrections[i, 0] += dx * share
            corrections[i, 1] += dy * share
            corrections[j, 0] -= dx * share
            corrections[j, 1] -= dy * share
    return bool(counts.any())


@njit(cache=True)
def _overlap_counts(positions: Floats, half_axes: Floats, radii: Floats) -> Floats:
    """Return for each walker how many others it overlaps, ``(n,)``."""
    counts = np.zeros(len(positions))
    for i in range(len(positions)):
        for j in range(i):
            if _overlap(positions, half_axes, radii, i, j)[3] > _TOLERANCE_M:
                counts[i] += 1.0
                counts[j] += 1.0
    return counts


@njit(cache=True)
def _overlap(
    positions: Floats, half_axes: Floats, radii: Floats, i: int, j: int
) -> tuple[float, float, float, float]:
    """Return the vector from `j` to `i` (x, y and length) and their overlap, metres.

    The vector is that between the nearest points of the axes. Where these cross it is that between
    the centres, and the x axis where the centres coincide.
    """
    dx, dy = positions[i, 0] - positions[j, 0], positions[i, 1] - positions[j, 1]
    width = radii[i] + radii[j]
    if _cross(dx, dy, half_axes[i], half_axes[j]):
        distance = math.hypot(dx, dy)
        if distance < 1e-9:
            return 1.0, 0.0, 1.0, width
        return dx, dy, distance, width
    dx, dy = _nearest(dx, dy, half_axes[i], half_axes[j])
    distance = math.hypot(dx, dy)
    return dx, dy, distance, width - distance


@njit(cache=True)
def _cross(dx: float, dy: float, one: Floats, other: Floats) -> bool:
    """Return whether two axes cross; points cross where they coincide.

    Args:
        dx: From the centre of the other axis to that of the one, metres.
        dy: Likewise.
        one: ``(2,)`` half of the one axis, metres.
        other: ``(2,)`` half of the other.
    """
    turned = one[0] * other[1] - one[1] * other[0]
    if abs(turned) < 1e-12:  # parallel, or points
        nearest_x, nearest_y = _nearest(dx, dy, one, other)
        return math.hypot(nearest_x, nearest_y) < 1e-9
    along_one = (other[0] * dy - other[1] * dx) / turned
    along_other = (one[0] * dy - one[1] * dx) / turned
    return bool(abs(along_one) <= 1.0 and abs(along_other) <= 1.0)


@njit(cache=True)
def _nearest(dx: float, dy: float, one: Floats, other: Floats) -> tuple[float, float]:
    """Return the shortest vector from the other axis to the one, which do not cross; see `_cross`.

    One of the two points is an end of an axis.
    """
    best_x, best_y = dx, dy
    best = math.inf
    for end in (-1.0, 1.0):
        # from the other axis to an end of the one
        x, y = dx + end * one[0], dy + end * one[1]
        share = _share(x, y, other)
        x, y = x - share * other[0], y - share * other[1]
        if x * x + y * y < best:
            best, best_x, best_y = x * x + y * y, x, y
        # from an end of the other axis to the one
        x, y = dx - end * other[0], dy - end * other[1]
        share = _share(-x, -y, one)
        x, y = x + share * one[0], y + share * one[1]
        if x * x + y * y < best:
            best, best_x, best_y = x * x + y * y, x, y
    return best_x, best_y


@njit(cache=True)
def _share(x: float, y: float, half_axis: Floats) -> float:
    """Return the place on an axis nearest to a point relative to its centre, in [-1, 1]."""
    squared = half_axis[0] * half_axis[0] + half_axis[1] * half_axis[1]
    if squared == 0.0:
        return 0.0
    share = (x * half_axis[0] + y * half_axis[1]) / squared
    return float(min(1.0, max(-1.0, share)))
