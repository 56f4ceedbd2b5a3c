"""Which paths of sound pass through boxes, inside a room and between rooms.

A reflected path is a straight line from the image source to the head. Folded at the walls that it
crosses, it becomes the polygon that the sound follows in the room (Allen & Berkley 1979, figure 1).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

_GRAZE_M = 1e-6
_INSIDE_M = 1e-3
"""A box counts as inside a room if it extends into it by more than this: walls touch the room."""


@njit(cache=True)
def crosses_box(one: Floats, other: Floats, centre: Floats, rotation: Floats, half: Floats) -> bool:
    """Return whether a segment passes through a box (slab test: Kay & Kajiya, SIGGRAPH 1986).

    Args:
        one: ``(3,)`` metres, one end of the segment.
        other: ``(3,)`` metres, its other end.
        centre: ``(3,)`` metres.
        rotation: ``(3, 3)`` from the axes of the box to the world's.
        half: ``(3,)`` metres, half of its edges.
    """
    length = np.sqrt(((other - one) ** 2).sum())
    enter, leave = 0.0, 1.0
    for axis in range(3):
        begin = way = 0.0
        for k in range(3):
            begin += (one[k] - centre[k]) * rotation[k, axis]
            way += (other[k] - one[k]) * rotation[k, axis]
        if abs(way) < 1e-12:
            if abs(begin) > half[axis] - _GRAZE_M:
                return False
            continue
        first, second = (-half[axis] - begin) / way, (half[axis] - begin) / way
        enter = max(enter, min(first, second))
        leave = min(leave, max(first, second))
    return bool((leave - enter) * length > _GRAZE_M)


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

    A source in a box is part of it, such as a loudspeaker in a cabinet. See `crosses_box`.
    """
    count = 0
    for n in range(len(centres)):
        box = centres[n], rotations[n], halves[n]
        if contains_point(one, *box) or contains_point(other, *box):
            continue
        count += crosses_box(one, other, *box)
    return count


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


@njit(cache=True)
def any_extends_into(
    centres: Floats, rotations: Floats, halves: Floats, lower: Floats, size: Floats
) -> bool:
    """Return whether one of the boxes ``(n, ...)`` reaches into a room, see `extends_into`."""
    for n in range(len(centres)):
        if extends_into(centres[n], rotations[n], halves[n], lower, size):
            return True
    return False


@njit(cache=True)
def count_crossed_inside(
    source: Floats,
    head: Floats,
    lower: Floats,
    size: Floats,
    lattice: NDArray[np.int64],
    centres: Floats,
    rotations: Floats,
    halves: Floats,
) -> NDArray[np.int64]:
    """Return how many boxes in a room each path inside it passes.

    A box counts once for each path. Boxes that only touch the room, and those round the source or
    the head, are left out.

    Args:
        source: ``(3,)`` metres in the room.
        head: ``(3,)`` metres in the room.
        lower: ``(3,)`` metres, the room's lower corner.
        size: ``(3,)`` metres.
        lattice: ``(K, 3)`` from `image_lattice`.
        centres: ``(n, 3)`` metres.
        rotations: ``(n, 3, 3)`` from the axes of the boxes to the world's.
        halves: ``(n, 3)`` metres.

    Returns:
        ``(K,)``.
    """
    counts = np.zeros(len(lattice), np.int64)
    for n in range(len(centres)):
        box = centres[n], rotations[n], halves[n]
        if not extends_into(*box, lower, size):
            continue
        if contains_point(source, *box) or contains_point(head, *box):
            continue
        for k in range(len(lattice)):
            counts[k] += _folded_path_crosses(source, head, lower, size, lattice[k], box)
    return counts


@njit(cache=True)
def _folded_path_crosses(
    source: Floats,
    head: Floats,
    lower: Floats,
    size: Floats,
    reflections: NDArray[np.int64],
    box: tuple[Floats, Floats, Floats],
) -> bool:
    """Return whether one path from a source to a head, folded at the walls, passes a box.

    Args:
        source: See `count_crossed_inside`.
        head: Likewise.
        lower: Likewise.
        size: Likewise.
        reflections: ``(3,)`` one row of `image_lattice`.
        box: Centre, rotation and half edges.
    """
    start, way = np.empty(3), np.empty(3)  # of the unfolded line, in the room's coordinates
    for axis in range(3):
        n = reflections[axis]
        inside = source[axis] - lower[axis]
        start[axis] = head[axis] - lower[axis]
        image = n * size[axis] + (inside if n % 2 == 0 else size[axis] - inside)
        way[axis] = image - start[axis]
    cell = np.zeros(3, np.int64)  # copy of the room that the line is in
    share, one, other = 0.0, head.copy(), np.empty(3)
    for _ in range(1 + np.abs(reflections).sum()):
        until, crossed = 1.0, -1
        for axis in range(3):
            if cell[axis] == reflections[axis]:
                continue
            wall = (cell[axis] + (1 if way[axis] > 0.0 else 0)) * size[axis]
            at = (wall - start[axis]) / way[axis]
            if crossed < 0 or at < until:
                until, crossed = at, axis
        for axis in range(3):
            along = start[axis] + until * way[axis] - cell[axis] * size[axis]
            mirrored = along if cell[axis] % 2 == 0 else size[axis] - along
            other[axis] = lower[axis] + mirrored
        if until > share and crosses_box(one, other, *box):
            return True
        if crossed < 0:
            return False
        cell[crossed] += 1 if way[crossed] > 0.0 else -1
        share = until
        one[:] = other
    return False
