"""Geometry of boxes and straight lines: what a line passes through, and what reaches into rooms."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

_GRAZE_M = 1e-6
_INSIDE_M = 1e-3
"""A box counts as inside a room if it extends into it by more than this; walls touch the room."""


@njit(cache=True)
def crosses_box(one: Floats, other: Floats, centre: Floats, rotation: Floats, half: Floats) -> bool:
    """Return whether a segment passes through a box, see `stretch_in_box`."""
    enter, leave = stretch_in_box(one, other, centre, rotation, half)
    return bool(leave - enter > _GRAZE_M)


@njit(cache=True)
def stretch_in_box(
    one: Floats, other: Floats, centre: Floats, rotation: Floats, half: Floats
) -> tuple[float, float]:
    """Return where a segment enters and leaves a box (Kay & Kajiya, SIGGRAPH 1986: slab test).

    Args:
        one: ``(3,)`` metres, one end of the segment.
        other: ``(3,)`` metres, its other end.
        centre: ``(3,)`` metres.
        rotation: ``(3, 3)`` from the axes of the box to the world's.
        half: ``(3,)`` metres, half of its edges.

    Returns:
        Metres from `one`; the second is not greater than the first if the segment misses the box.
    """
    enter, leave, square = 0.0, 1.0, 0.0
    for axis in range(3):
        square += (other[axis] - one[axis]) ** 2
        begin = way = 0.0
        for k in range(3):
            begin += (one[k] - centre[k]) * rotation[k, axis]
            way += (other[k] - one[k]) * rotation[k, axis]
        if abs(way) < 1e-12:
            if abs(begin) > half[axis] - _GRAZE_M:
                return 0.0, 0.0
            continue
        first, second = (-half[axis] - begin) / way, (half[axis] - begin) / way
        enter = max(enter, min(first, second))
        leave = min(leave, max(first, second))
    length_m = np.sqrt(square)
    return float(enter * length_m), float(leave * length_m)


@njit(cache=True)
def contains_point(point: Floats, centre: Floats, rotation: Floats, half: Floats) -> bool:
    """Return whether a point ``(3,)`` is in a box, see `crosses_box`."""
    for axis in range(3):
        along = 0.0
        for k in range(3):
            along += (point[k] - centre[k]) * rotation[k, axis]
        if abs(along) > half[axis]:
            return False
    return True


@njit(cache=True)
def count_crossed(
    one: Floats, other: Floats, centres: Floats, rotations: Floats, halves: Floats
) -> int:
    """Return how many boxes ``(n, ...)`` a segment passes, those round one of its ends left out.

    A source in a box is part of it, such as a loudspeaker in a cabinet. See `crosses_box`. Pieces
    of one wall count once: a segment can pass from the piece above a door into the one beside it.
    """
    crossed = np.empty(len(centres), np.int64)
    count = 0
    for n in range(len(centres)):
        box = centres[n], rotations[n], halves[n]
        if contains_point(one, *box) or contains_point(other, *box):
            continue
        if not crosses_box(one, other, *box):
            continue
        is_known = False
        for k in range(count):
            m = crossed[k]
            is_known = is_known or have_common_faces((centres[m], rotations[m], halves[m]), box)
        if not is_known:
            crossed[count] = n
            count += 1
    return count


@njit(cache=True)
def have_common_faces(
    first: tuple[Floats, Floats, Floats], box: tuple[Floats, Floats, Floats]
) -> bool:
    """Return whether the two largest faces of one box are in the planes of those of another one.

    Args:
        first: Centre ``(3,)``, rotation ``(3, 3)`` and half edges ``(3,)`` of a box.
        box: Those of the other one.
    """
    axis, other_axis = np.argmin(first[2]), np.argmin(box[2])
    cosine = apart_m = 0.0
    for k in range(3):
        cosine += first[1][k, axis] * box[1][k, other_axis]
        apart_m += (box[0][k] - first[0][k]) * first[1][k, axis]
    thickness_m = first[2][axis] - box[2][other_axis]
    parallel = abs(cosine) > 1.0 - _GRAZE_M
    return bool(parallel and abs(apart_m) < _GRAZE_M and abs(thickness_m) < _GRAZE_M)


@njit(cache=True)
def extends_into(
    centre: Floats, rotation: Floats, half: Floats, lower: Floats, size: Floats
) -> bool:
    """Return whether the box round a box reaches into a room with this corner and size."""
    for axis in range(3):
        extent = 0.0
        for k in range(3):
            extent += abs(rotation[axis, k]) * half[k]
        below = centre[axis] + extent - lower[axis]
        above = lower[axis] + size[axis] - (centre[axis] - extent)
        if min(below, above) < _INSIDE_M:
            return False
    return True


@njit(cache=True, error_model="numpy")
def next_wall(
    start: Floats,
    way: Floats,
    size: Floats,
    cell: NDArray[np.int64],
    reflections: NDArray[np.int64],
) -> tuple[float, int]:
    """Return the share of a line up to the next wall, and its axis: 1 and -1 if there is none.

    Args:
        start: ``(3,)`` metres, begin of the line in the coordinates of the room.
        way: ``(3,)`` metres, from there to its end.
        size: ``(3,)`` metres, the room's.
        cell: ``(3,)`` copy of the room that the line is in.
        reflections: ``(3,)`` copy of the room in which it ends.
    """
    share, crossed = 1.0, -1
    for axis in range(3):
        if cell[axis] == reflections[axis]:
            continue
        wall = (cell[axis] + (1 if way[axis] > 0.0 else 0)) * size[axis]
        at = (wall - start[axis]) / way[axis]
        if crossed < 0 or at < share:
            share, crossed = at, axis
    return share, crossed
