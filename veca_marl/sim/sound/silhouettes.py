"""Silhouettes of obstacles: the rectangles that they cover in the plane across a path of sound.

An edge that meets the floor, the ceiling or another wall is none: the rectangle has no end there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import compiled, kernel
from veca_marl.sim.sound.partitions import N_BANDS
from veca_marl.sim.sound.room_acoustics import SPEED_OF_SOUND_MPS

MOST_SETS = 128
"""Sets of silhouettes of which one composite remembers the transmission."""

MOST_MOVING = 4
"""Leaves near one path that count as neither open nor closed; of others the nearer one counts."""

# Fresnel parameter over the root of the frequency by which an edge is moved that is none, and one
# below which a movement is hardly heard: between them it grows exponentially, so that an edge that
# begins to meet something does so gradually
_SEALED, _BARELY_SEALED = 1e3, 0.02
_STRADDLED_M = 0.05  # a joint with another wall closes a wall that the path meets so far from it
_FAR_M, _FAR_RATIO = 6.0, 0.5  # beyond that beside a path obstacles are left out

BOX, LEAF, CLOSED = 0, 1, 2


class Screens(NamedTuple):
    """What attenuates sound: boxes, and leaves of doors.

    Attributes:
        centres: ``(n, 3)`` metres.
        rotations: ``(n, 3, 3)`` from the axes of the boxes to the world's.
        halves: ``(n, 3)`` metres, half of their edges.
        bounds: ``(n, 3, 2)`` from 0 to 1: how far the faces in the negative and in the positive
            direction of each axis meet the floor, the ceiling or the end of the air.
        joints: ``(n, 3, 2)`` 1 for faces that meet another wall.
        rooms: ``(n,)`` number of the room that they stand in, -1 for walls between rooms; of an
            opening, that of the room behind it.
        air: ``(n, 2, 3)`` metres, corners of the part of the house in which furniture counts for a
            path between rooms: its room, and what is behind the faces that it reaches through.
        kinds: ``(n,)`` `BOX`, `LEAF`, or `CLOSED`: a leaf where it would be closed.
        opens: ``(n,)`` how far a leaf is open, from 0 to 1; -1 for boxes.
        leaves: ``(n,)`` number of the leaf, where it is and where it would be closed; -1 for boxes.
    """

    centres: Floats
    rotations: Floats
    halves: Floats
    bounds: Floats
    joints: Floats
    rooms: NDArray[np.int64]
    air: Floats
    kinds: NDArray[np.int64]
    opens: Floats
    leaves: NDArray[np.int64]


class Line(NamedTuple):
    """A straight path, unfolded at the walls that reflect it.

    Attributes:
        start: ``(3,)`` metres.
        frame: ``(3, 3)``, rows: along it, across it in the horizontal plane, and across both.
        length_m: Its length.
    """

    start: Floats
    frame: Floats
    length_m: float


class Work(NamedTuple):
    """Arrays that are used again for each path: memory is not allocated for each.

    Attributes:
        corners: ``(8, 3)`` metres, of a box in the frame of a line.
        extent: ``(4,)`` metres, least and greatest offsets across the line and above it.
        detour: ``(4,)`` metres, by which the ways round these are longer, with their signs.
        rectangles: ``(m, 4)`` silhouettes of a path, see `add_silhouette`.
        numbers: ``(m,)`` of which screen each is; one screen can have several.
        depths: ``(m,)`` metres along the line.
        below: ``(m, 4, N_BANDS)`` fraction of the energy below each edge of these.
        chosen: ``(m,)`` the silhouettes of one composite, those at the least depth first.
        edges: ``(2, 2 m)`` numbers of their edges in order, ``2 * silhouette + side``, across and
            above.
        ordered: ``(2, 2 m + 2, N_BANDS)`` fraction of the energy below each of these edges in
            order, from 0 to 1.
        masks: ``(n,)`` sets of silhouettes of which the transmission is known.
        through: ``(n, N_BANDS)`` energy that passes these.
        part: ``(4, N_BANDS)`` the energy of a composite, and measures.
        opening: ``(4,)`` silhouette of an opening in a wall that reflects the path.
        passed: ``(N_BANDS,)`` fraction of the energy that passes the openings of that wall.
        reflected: ``(N_BANDS,)`` fraction that all walls reflect beside their openings.
        solid: ``(m,)`` screens that sound passes one after another.
        gaps: ``(m,)`` metres of air between these.
        start: ``(3,)`` metres, start of the path.
        frame: ``(3, 3)`` of its line.
        sign: ``(3,)`` of the coordinates in the copy of the room that it passes, 1 or -1.
        offset: ``(3,)`` metres, of these.
        begin: ``(3,)`` metres, start of the path in the coordinates of the room.
        way: ``(3,)`` metres, from its start to its end.
        cell: ``(3,)`` the copy of the room that it passes.
        moving: ``(MOST_MOVING,)`` screens of the leaves that are neither open nor closed.
    """

    corners: Floats
    extent: Floats
    detour: Floats
    rectangles: Floats
    numbers: NDArray[np.int64]
    depths: Floats
    below: Floats
    chosen: NDArray[np.int64]
    edges: NDArray[np.int64]
    ordered: Floats
    masks: NDArray[np.int64]
    through: Floats
    part: Floats
    opening: Floats
    passed: Floats
    reflected: Floats
    solid: NDArray[np.int64]
    gaps: Floats
    start: Floats
    frame: Floats
    sign: Floats
    offset: Floats
    begin: Floats
    way: Floats
    cell: NDArray[np.int64]
    moving: NDArray[np.int64]


@compiled
def make_work(most: int) -> Work:
    """Return arrays for paths with at most so many silhouettes."""
    return Work(
        np.empty((8, 3)),
        np.empty(4),
        np.empty(4),
        np.empty((most, 4)),
        np.empty(most, np.int64),
        np.empty(most),
        np.empty((most, 4, N_BANDS)),
        np.empty(most, np.int64),
        np.empty((2, 2 * most), np.int64),
        np.empty((2, 2 * most + 2, N_BANDS)),
        np.empty(MOST_SETS, np.int64),
        np.empty((MOST_SETS, N_BANDS)),
        np.empty((4, N_BANDS)),
        np.empty(4),
        np.empty(N_BANDS),
        np.empty(N_BANDS),
        np.empty(most, np.int64),
        np.empty(most),
        np.empty(3),
        np.empty((3, 3)),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3, np.int64),
        np.empty(MOST_MOVING, np.int64),
    )


@kernel
def write_line(start: Floats, end: Floats, line: Floats, frame: Floats) -> float:
    """Write the start and the frame of the line from one point ``(3,)`` to another, see `Line`.

    Points that are equal have a line along x.

    Returns:
        Metres, its length.
    """
    square = 0.0
    for axis in range(3):
        line[axis] = start[axis]
        frame[0, axis] = end[axis] - start[axis]
        square += frame[0, axis] ** 2
        frame[1, axis] = 0.0
    if start[0] == end[0] and start[1] == end[1] and start[2] == end[2]:
        frame[0, 0] = start[0] + 1e-6 - start[0]
        square = frame[0, 0] ** 2
    length_m = math.sqrt(square)
    for axis in range(3):
        frame[0, axis] /= length_m
    flat = math.hypot(frame[0, 0], frame[0, 1])
    if flat > 1e-9:
        frame[1, 0], frame[1, 1] = -frame[0, 1] / flat, frame[0, 0] / flat
    else:
        frame[1, 0] = 1.0
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        frame[2, axis] = frame[0, i] * frame[1, j] - frame[0, j] * frame[1, i]
    return length_m


@kernel
def add_silhouette(
    line: Line,
    begin_m: float,
    end_m: float,
    screens: Screens,
    number: int,
    mirror: tuple[Floats, Floats],
    work: Work,
    rectangle: Floats,
) -> float:
    """Write the silhouette of the part of a screen between two planes across a line.

    Args:
        line: The line.
        begin_m: Distance of the first plane from the start of the line.
        end_m: Distance of the second one.
        screens: All screens.
        number: Which of them.
        mirror: Sign and offset ``(3,)``: the image of a point is ``sign * point + offset``.
        work: Overwritten.
        rectangle: ``(4,)``, overwritten: Fresnel parameters over the root of the frequency of its
            edges, least and greatest across the line, least and greatest above it.

    Returns:
        Distance of its middle along the line, and infinity if nothing of it is there.
    """
    corners, extent, detour = work.corners, work.extent, work.detour
    # most screens are in front of the planes or behind them: their other corners are not needed
    centre_m, half_m = _write_corners(line, screens, number, mirror, 0, corners)
    reach = centre_m - half_m, centre_m + half_m
    begin_m, end_m = max(begin_m, reach[0]), min(end_m, reach[1])
    if end_m - begin_m < 1e-9:
        return np.inf
    beside_m = -np.inf
    for row in range(1, 3):
        centre_m, half_m = _write_corners(line, screens, number, mirror, row, corners)
        beside_m = max(beside_m, abs(centre_m) - half_m)
    if beside_m > max(_FAR_M, _FAR_RATIO * line.length_m):
        return np.inf
    for side in range(4):
        extent[side] = detour[side] = np.inf if side % 2 == 0 else -np.inf
    for corner in range(8):
        at = corners[corner, 0]
        if begin_m - 1e-9 <= at <= end_m + 1e-9:
            _add_point(line.length_m, at, corners[corner, 1], corners[corner, 2], work)
    if reach[0] < begin_m:
        _add_section(line.length_m, begin_m, work)
    if reach[1] > end_m:
        _add_section(line.length_m, end_m, work)
    if extent[1] < extent[0]:
        return np.inf
    for side in range(4):
        size = 2.0 * math.sqrt(abs(detour[side]) / SPEED_OF_SOUND_MPS)
        rectangle[side] = math.copysign(size, detour[side])
    _seal(line, screens, number, mirror[0], extent, rectangle)
    return 0.5 * (begin_m + end_m)


@kernel
def _write_corners(
    line: Line,
    screens: Screens,
    number: int,
    mirror: tuple[Floats, Floats],
    row: int,
    corners: Floats,
) -> tuple[float, float]:
    """Write one coordinate of the corners of a screen in a line's frame, metres.

    Args:
        line: The line.
        screens: All screens.
        number: Which of them.
        mirror: See `add_silhouette`.
        row: Which coordinate, a row of `Line.frame`.
        corners: ``(8, 3)``; one column is overwritten.

    Returns:
        That coordinate of its centre, and by how much the corners differ from it at most.
    """
    centre, reach = 0.0, 0.0
    for axis in range(3):
        at = mirror[0][axis] * screens.centres[number, axis] + mirror[1][axis]
        centre += line.frame[row, axis] * (at - line.start[axis])
    corners[0, row] = centre
    for k in range(3):
        edge = 0.0
        for axis in range(3):
            turned = mirror[0][axis] * screens.rotations[number, axis, k]
            edge += line.frame[row, axis] * turned * screens.halves[number, k]
        reach += abs(edge)
        n = 1 << k
        for corner in range(n):
            corners[corner + n, row] = corners[corner, row] + edge
            corners[corner, row] -= edge
    return centre, reach


@kernel
def _add_section(length_m: float, at_m: float, work: Work) -> None:
    """Extend a silhouette by the section of a box with a plane across the line.

    Args:
        length_m: Length of the line.
        at_m: Distance of the plane from the start of the line.
        work: Has the corners, and the silhouette that is updated.
    """
    corners = work.corners
    for low in range(8):
        for k in range(3):
            high = low | 1 << k
            if high == low:
                continue
            begin, end = corners[low, 0], corners[high, 0]
            if (begin < at_m) == (end < at_m):
                continue
            ratio = (at_m - begin) / (end - begin)
            across = corners[low, 1] + ratio * (corners[high, 1] - corners[low, 1])
            above = corners[low, 2] + ratio * (corners[high, 2] - corners[low, 2])
            _add_point(length_m, at_m, across, above, work)


@kernel
def _add_point(length_m: float, along: float, across: float, above: float, work: Work) -> None:
    """Extend a silhouette by a point of a box, in metres in the frame of the line."""
    extent, detour = work.extent, work.detour
    along = min(max(along, 0.0), length_m)
    rest = length_m - along
    for axis in range(2):
        offset = across if axis == 0 else above
        square = offset * offset
        more = math.sqrt(along * along + square) + math.sqrt(rest * rest + square)
        more = math.copysign(max(more - length_m, 0.0), offset)
        least, most = 2 * axis, 2 * axis + 1
        extent[least] = min(extent[least], offset)
        extent[most] = max(extent[most], offset)
        detour[least], detour[most] = min(detour[least], more), max(detour[most], more)


@kernel
def _seal(
    line: Line,
    screens: Screens,
    number: int,
    sign: Floats,
    extent: Floats,
    rectangle: Floats,
) -> None:
    """Move the edges of a silhouette that meet something outwards, see `Screens`.

    An edge on the other side of the line stays: moved outwards it would pass over the line.
    """
    for axis in range(2):
        lit = max(-extent[2 * axis], 0.0), max(extent[2 * axis + 1], 0.0)
        straddled = min(lit[0] / _STRADDLED_M, 1.0) * min(lit[1] / _STRADDLED_M, 1.0)
        for k in range(3):
            normal, world = 0.0, 0
            for j in range(3):
                normal += line.frame[axis + 1, j] * sign[j] * screens.rotations[number, j, k]
                if abs(screens.rotations[number, j, k]) > abs(screens.rotations[number, world, k]):
                    world = j
            # floor, ceiling and outer walls are across axes of the world; a box may be tilted
            across = line.frame[axis + 1, world] * sign[world]
            across *= 1.0 if screens.rotations[number, world, k] > 0.0 else -1.0
            for side in range(2):
                face = side if normal > 0.0 else 1 - side
                moved = _sealed(straddled * screens.joints[number, k, face]) * normal * normal
                face = side if across > 0.0 else 1 - side
                own = min(lit[side] / _STRADDLED_M, 1.0)
                bound = _sealed(own * screens.bounds[number, k, face]) * across * across
                moved = max(moved, bound)
                rectangle[2 * axis + side] += moved if side == 1 else -moved


@kernel
def _sealed(share: float) -> float:
    """Return by what an edge is moved that meets something in part: a share from 0 to 1."""
    if share <= 0.0:
        return 0.0
    return _BARELY_SEALED * (math.exp(share * math.log(_SEALED / _BARELY_SEALED + 1.0)) - 1.0)
