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
    bounds: tuple[Floats, Floats],
    lower: Floats,
    size: Floats,
    lattice: NDArray[np.int64],
    centres: Floats,
    rotations: Floats,
    halves: Floats,
) -> NDArray[np.int64]:
    """Return how many boxes in a room each path inside it passes.

    A box counts once for each path, and so do boxes with common faces, the pieces of one wall.
    Boxes that only touch the room, and those round the source or the head, are left out.

    Args:
        source: ``(3,)`` metres, moved to the nearest point within the bounds.
        head: ``(3,)`` metres, likewise.
        bounds: Least and greatest coordinates ``(3,)`` of sources and heads, see `Room.bounds`.
        lower: ``(3,)`` metres, the room's lower corner.
        size: ``(3,)`` metres.
        lattice: ``(K, 3)`` from `image_lattice`.
        centres: ``(n, 3)`` metres.
        rotations: ``(n, 3, 3)`` from the axes of the boxes to the world's.
        halves: ``(n, 3)`` metres.

    Returns:
        ``(K,)``.
    """
    begin, end = within_bounds(source, bounds), within_bounds(head, bounds)
    corners, n_corners = folded_paths(begin, end, lower, size, lattice)
    counts = np.zeros(len(lattice), np.int64)
    crossed = np.zeros((len(centres), len(lattice)), np.bool_)
    for n in range(len(centres)):
        box = centres[n], rotations[n], halves[n]
        if not extends_into(*box, lower, size):
            continue
        if contains_point(begin, *box) or contains_point(end, *box):
            continue
        for k in range(len(lattice)):
            if polygon_crosses(corners[k, : n_corners[k]], *box):
                crossed[n, k] = True
                counts[k] += not _counted_before(n, crossed[:, k], centres, rotations, halves)
    return counts


@njit(cache=True)
def _counted_before(
    number: int,
    crossed: NDArray[np.bool_],
    centres: Floats,
    rotations: Floats,
    halves: Floats,
) -> bool:
    """Return whether a path has crossed an earlier box that is a piece of the same wall."""
    box = centres[number], rotations[number], halves[number]
    for n in range(number):
        if crossed[n] and have_common_faces((centres[n], rotations[n], halves[n]), box):
            return True
    return False


@njit(cache=True)
def within_bounds(point: Floats, bounds: tuple[Floats, Floats]) -> Floats:
    """Return the nearest point ``(3,)`` within bounds."""
    nearest = np.empty(3)
    for axis in range(3):
        nearest[axis] = min(max(point[axis], bounds[0][axis]), bounds[1][axis])
    return nearest


@njit(cache=True)
def folded_paths(
    source: Floats, head: Floats, lower: Floats, size: Floats, lattice: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.int64]]:
    """Return the corners of all paths from a head to a source in a room, folded at the walls.

    Args:
        source: ``(3,)`` metres in the room.
        head: ``(3,)`` metres in the room.
        lower: See `count_crossed_inside`.
        size: Likewise.
        lattice: Likewise.

    Returns:
        ``(K, n, 3)`` metres, and ``(K,)`` how many of the n corners belong to each path.
    """
    corners = np.empty((len(lattice), 2 + np.abs(lattice).sum(axis=1).max(), 3))
    n_corners = np.empty(len(lattice), np.int64)
    for k in range(len(lattice)):
        n_corners[k] = _write_folded_path(source, head, lower, size, lattice[k], corners[k])
    return corners, n_corners


@njit(cache=True)
def _write_folded_path(
    source: Floats,
    head: Floats,
    lower: Floats,
    size: Floats,
    reflections: NDArray[np.int64],
    corners: Floats,
) -> int:
    """Write the corners of one path from a head to a source, folded at the walls.

    Args:
        source: ``(3,)`` metres in the room.
        head: ``(3,)`` metres in the room.
        lower: See `count_crossed_inside`.
        size: Likewise.
        reflections: ``(3,)`` one row of `image_lattice`.
        corners: ``(n, 3)`` metres, overwritten: the head, points on walls, the source. There are
            2 more of them than reflections.

    Returns:
        The number of corners.
    """
    start, way = np.empty(3), np.empty(3)  # of the unfolded line, in the room's coordinates
    for axis in range(3):
        n = reflections[axis]
        inside = source[axis] - lower[axis]
        start[axis] = head[axis] - lower[axis]
        image = n * size[axis] + (inside if n % 2 == 0 else size[axis] - inside)
        way[axis] = image - start[axis]
        corners[0, axis] = head[axis]
    cell = np.zeros(3, np.int64)  # copy of the room that the line is in
    last = len(corners) - 1
    for corner in range(1, last + 1):
        share, crossed = _next_wall(start, way, size, cell, reflections)
        for axis in range(3):
            along = start[axis] + share * way[axis] - cell[axis] * size[axis]
            mirrored = along if cell[axis] % 2 == 0 else size[axis] - along
            corners[corner, axis] = lower[axis] + mirrored
        if crossed < 0:
            return corner + 1
        cell[crossed] += 1 if way[crossed] > 0.0 else -1
    return last + 1


@njit(cache=True)
def _next_wall(
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


@njit(cache=True)
def polygon_crosses(corners: Floats, centre: Floats, rotation: Floats, half: Floats) -> bool:
    """Return whether a segment between corners ``(n, 3)`` passes a box, see `crosses_box`."""
    for n in range(len(corners) - 1):
        if crosses_box(corners[n], corners[n + 1], centre, rotation, half):
            return True
    return False
