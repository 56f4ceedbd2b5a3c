"""Energy that passes obstacles: round their edges by diffraction, through them by transmission.

Every obstacle is a rectangle in the plane across a path, its silhouette. An edge of it lies at the
Fresnel parameter ``nu = +-sqrt(2 N)``, with the Fresnel number ``N = 2 detour / wavelength`` of the
way round it (Maekawa 1968, Noise reduction by screens, Applied Acoustics 1). A fraction

    F(nu) = (1 + nu / sqrt(nu^2 + 0.4)) / 2

of the energy arrives by what is on one side of such an edge. Behind a half-plane that leaves
Maekawa's level, -10 lg(3 + 20 N) dB, within 0.3 dB from N = 0.1 up; at the edge of the shadow it is
-3 dB, where Maekawa and Kurze & Anderson (1971, Sound attenuation by barriers, Applied Acoustics 4)
have -5 dB: what the shadow receives there, the lit side lacks. F is a distribution, so each
rectangle across the path has a measure, ``(F(nu2) - F(nu1))`` along both axes multiplied, and all
of them add up to 1. The energy that arrives is the sum over all rectangles of measure times
transmission, as for a wall of several parts (composite transmission loss; Kuttruff 2016). Hence it
is continuous in the poses of all obstacles, grows as they shrink, is equal with both ends
exchanged, 1 without an obstacle, and that of the material behind an infinite one.

An edge that meets the floor, the ceiling or another wall is none: the rectangle has no end there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.octave_bands import BANDS_HZ, N_BANDS
from veca_marl.sim.sound.partitions import energy_through
from veca_marl.sim.sound.room_acoustics import SPEED_OF_SOUND_MPS

NEGLIGIBLE = 0.05
"""An obstacle that takes less than this fraction of the energy takes none (0.2 dB); the rest is
divided by one minus it, so that energy stays continuous."""

_SPREAD = 0.4  # of F: 10 lg(20 N) far in the shadow
_SEALED = 1e3  # Fresnel parameter over the root of the frequency of an edge that is none
_STRADDLED_M = 0.05  # a joint with another wall closes a wall that the path meets so far from it
_FAR_M, _FAR_RATIO = 6.0, 0.5  # beyond that beside a path obstacles are left out
_MOST = 62  # silhouettes of one path; they are bits of an integer
_NOTHING = 1e-9  # measure
_ROOT_BANDS: Floats = np.sqrt(BANDS_HZ)


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
        rooms: ``(n,)`` number of the room that they stand in, -1 for walls between rooms.
        kinds: ``(n,)`` `BOX`, `LEAF`, or `CLOSED`: a leaf where it would be closed.
        opens: ``(n,)`` how far a leaf is open, from 0 to 1; -1 for boxes.
    """

    centres: Floats
    rotations: Floats
    halves: Floats
    bounds: Floats
    joints: Floats
    rooms: NDArray[np.int64]
    kinds: NDArray[np.int64]
    opens: Floats


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
    """Arrays that are used again for each silhouette.

    Attributes:
        corners: ``(8, 3)`` metres, of a box in the frame of a line.
        extent: ``(4,)`` metres, least and greatest offsets across the line and above it.
        detour: ``(4,)`` metres, by which the ways round these are longer, with their signs.
    """

    corners: Floats
    extent: Floats
    detour: Floats


@njit(cache=True, error_model="numpy")
def line_between(start: Floats, end: Floats) -> Line:
    """Return the line from one point ``(3,)`` to another; they must not be equal."""
    way = end - start
    length_m = math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
    frame = np.zeros((3, 3))
    frame[0] = way / length_m
    flat = math.hypot(frame[0, 0], frame[0, 1])
    if flat > 1e-9:
        frame[1, 0], frame[1, 1] = -frame[0, 1] / flat, frame[0, 0] / flat
    else:
        frame[1, 0] = 1.0
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        frame[2, axis] = frame[0, i] * frame[1, j] - frame[0, j] * frame[1, i]
    return Line(start, frame, length_m)


@njit(cache=True, error_model="numpy")
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
    reach = _write_corners(line, screens, number, mirror, corners)
    begin_m, end_m = max(begin_m, reach[0]), min(end_m, reach[1])
    if end_m - begin_m < 1e-9 or reach[2] > max(_FAR_M, _FAR_RATIO * line.length_m):
        return np.inf
    for side in range(4):
        extent[side] = detour[side] = np.inf if side % 2 == 0 else -np.inf
    for corner in range(8):
        for k in range(3):
            if not corner & (1 << k):
                _add_edge(line.length_m, begin_m, end_m, corner, corner | 1 << k, work)
    if extent[1] < extent[0]:
        return np.inf
    for side in range(4):
        size = 2.0 * math.sqrt(abs(detour[side]) / SPEED_OF_SOUND_MPS)
        rectangle[side] = math.copysign(size, detour[side])
    _seal(line, screens, number, mirror[0], extent, rectangle)
    return 0.5 * (begin_m + end_m)


@njit(cache=True, error_model="numpy")
def _write_corners(
    line: Line, screens: Screens, number: int, mirror: tuple[Floats, Floats], corners: Floats
) -> tuple[float, float, float]:
    """Write the corners of a screen in a line's frame, ``(8, 3)`` metres.

    Returns:
        Least and greatest distance along the line, and how far it is beside or above it at least.
    """
    least, most, beside = 0.0, 0.0, -np.inf
    for row in range(3):
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
        if row == 0:
            least, most = centre - reach, centre + reach
        else:
            beside = max(beside, abs(centre) - reach)
    return least, most, beside


@njit(cache=True, error_model="numpy")
def _add_edge(
    length_m: float, begin_m: float, end_m: float, low: int, high: int, work: Work
) -> None:
    """Extend a silhouette by the part of a box's edge between two planes.

    Args:
        length_m: Length of the line.
        begin_m: See `add_silhouette`.
        end_m: Likewise.
        low: Number of the corner at one end of the edge.
        high: That at the other end.
        work: Has the corners, and the silhouette that is updated.
    """
    corners, extent, detour = work.corners, work.extent, work.detour
    first, last = 0.0, 1.0
    begin, way = corners[low, 0], corners[high, 0] - corners[low, 0]
    if abs(way) < 1e-12:
        if begin < begin_m - 1e-9 or begin > end_m + 1e-9:
            return
    else:
        one, other = (begin_m - begin) / way, (end_m - begin) / way
        first, last = max(first, min(one, other)), min(last, max(one, other))
        if first > last:
            return
    for end in range(2):
        share = first if end == 0 else last
        along = min(max(begin + share * way, 0.0), length_m)
        rest = length_m - along
        for axis in range(2):
            offset = corners[low, axis + 1]
            offset += share * (corners[high, axis + 1] - offset)
            square = offset * offset
            more = math.sqrt(along * along + square) + math.sqrt(rest * rest + square)
            more = math.copysign(max(more - length_m, 0.0), offset)
            least, most = 2 * axis, 2 * axis + 1
            extent[least] = min(extent[least], offset)
            extent[most] = max(extent[most], offset)
            detour[least], detour[most] = min(detour[least], more), max(detour[most], more)


@njit(cache=True, error_model="numpy")
def _seal(
    line: Line,
    screens: Screens,
    number: int,
    sign: Floats,
    extent: Floats,
    rectangle: Floats,
) -> None:
    """Move the edges of a silhouette that meet something outwards, see `Screens`."""
    for axis in range(2):
        lit = max(-extent[2 * axis], 0.0), max(extent[2 * axis + 1], 0.0)
        straddled = min(lit[0] / _STRADDLED_M, 1.0) * min(lit[1] / _STRADDLED_M, 1.0)
        for k in range(3):
            normal = 0.0
            for j in range(3):
                normal += line.frame[axis + 1, j] * sign[j] * screens.rotations[number, j, k]
            for side in range(2):
                face = side if normal > 0.0 else 1 - side
                closed = screens.bounds[number, k, face]
                closed = max(closed, straddled * screens.joints[number, k, face])
                moved = _SEALED * closed * normal * normal
                rectangle[2 * axis + side] += moved if side == 1 else -moved


@njit(cache=True, error_model="numpy")
def energy_past(
    rectangles: Floats,
    numbers: NDArray[np.int64],
    depths: Floats,
    screens: Screens,
    surface_ratio: float,
    energy: Floats,
) -> None:
    """Write the fraction of the energy that arrives in each octave band.

    A closed leaf and the wall round it are one screen. An open leaf stands apart from its opening:
    sound passes both one after another. Between these the level changes linearly with the openness
    of the leaf: the channel that a leaf opens at its frame is no straight way through it.

    Args:
        rectangles: ``(m, 4)`` silhouettes, see `add_silhouette`; overwritten.
        numbers: ``(m,)`` of which screen each is; one screen can have several; overwritten.
        depths: ``(m,)`` metres along the line; overwritten.
        screens: All screens.
        surface_ratio: See `partitions.energy_through`.
        energy: ``(N_BANDS,)``, overwritten.
    """
    openness = -1.0
    for m in range(len(numbers)):
        if screens.kinds[numbers[m]] != BOX and _matters(rectangles[m]):
            each = screens.opens[numbers[m]]
            openness = each if openness < 0.0 else min(openness, each)
    energy[:] = 1.0
    part = np.empty(N_BANDS)
    solid = screens.kinds[numbers] == BOX
    if openness > 0.0:
        for number in _leaves_of(numbers, screens):
            chosen = numbers == number if number >= 0 else solid
            _write_composite(
                rectangles[chosen], numbers[chosen], depths[chosen], screens, surface_ratio, part
            )
            energy *= part
    if openness < 1.0:
        chosen = screens.kinds[numbers] != LEAF
        _write_composite(
            rectangles[chosen], numbers[chosen], depths[chosen], screens, surface_ratio, part
        )
        apart = max(openness, 0.0)
        for band in range(N_BANDS):
            energy[band] = energy[band] ** apart * part[band] ** (1.0 - apart)


@njit(cache=True, error_model="numpy")
def _leaves_of(numbers: NDArray[np.int64], screens: Screens) -> NDArray[np.int64]:
    """Return -1, for all that are no leaves, and the numbers of the leaves."""
    leaves = np.full(len(numbers) + 1, -1)
    count = 1
    for number in numbers:
        if screens.kinds[number] == LEAF and not (leaves[:count] == number).any():
            leaves[count] = number
            count += 1
    return leaves[:count]


@njit(cache=True, error_model="numpy")
def _write_composite(
    rectangles: Floats,
    numbers: NDArray[np.int64],
    depths: Floats,
    screens: Screens,
    surface_ratio: float,
    energy: Floats,
) -> None:
    """Write the energy that passes all screens as rectangles in one plane; see `energy_past`."""
    known, bits, n_kept = _distinct(rectangles, numbers, depths)
    energy[:] = 0.0
    across, above = _sorted(rectangles, n_kept, 0), _sorted(rectangles, n_kept, 2)
    widths, heights = _measures(across), _measures(above)
    n = 2 * n_kept + 1
    cover = np.zeros((n, n), np.int64)
    for m in range(n_kept):
        for i in range(_index(across, rectangles[m, 0]), _index(across, rectangles[m, 1])):
            for j in range(_index(above, rectangles[m, 2]), _index(above, rectangles[m, 3])):
                cover[i + 1, j + 1] |= np.int64(1) << bits[m]
    masks, through = np.empty(n * n, np.int64), np.empty((n * n, N_BANDS))
    n_masks = mask = 0
    for i in range(n):
        if widths[i].max() < _NOTHING:
            continue
        for j in range(n):
            if heights[j].max() < _NOTHING:
                continue
            if n_masks == 0 or masks[mask] != cover[i, j]:
                mask = 0
                while mask < n_masks and masks[mask] != cover[i, j]:
                    mask += 1
            if mask == n_masks:
                masks[mask] = cover[i, j]
                n_masks += 1
                _energy_through_all(cover[i, j], known, screens, surface_ratio, through[mask])
            for band in range(N_BANDS):
                energy[band] += widths[i, band] * heights[j, band] * through[mask, band]
    for band in range(N_BANDS):
        energy[band] = min(energy[band] / (1.0 - NEGLIGIBLE), 1.0)


@njit(cache=True, error_model="numpy")
def _distinct(
    rectangles: Floats, numbers: NDArray[np.int64], depths: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Move the silhouettes that matter to the front, those at the least depth first.

    Args:
        rectangles: See `energy_past`; sorted.
        numbers: Likewise.
        depths: Likewise.

    Returns:
        The screens in that order, the bit of each silhouette, and how many silhouettes matter.
    """
    n_kept = 0
    for m in range(len(numbers)):
        if not _matters(rectangles[m]):
            continue
        left, right, low, high = rectangles[m]
        number, depth, at = numbers[m], depths[m], n_kept
        while at > 0 and depths[at - 1] > depth:
            rectangles[at], numbers[at], depths[at] = (
                rectangles[at - 1],
                numbers[at - 1],
                depths[at - 1],
            )
            at -= 1
        rectangles[at, 0], rectangles[at, 1] = left, right
        rectangles[at, 2], rectangles[at, 3] = low, high
        numbers[at], depths[at] = number, depth
        n_kept += 1
    n_kept = min(n_kept, _MOST)
    known, bits = np.empty(n_kept, np.int64), np.empty(n_kept, np.int64)
    n_known = 0
    for m in range(n_kept):
        bit = 0
        while bit < n_known and known[bit] != numbers[m]:
            bit += 1
        if bit == n_known:
            known[bit] = numbers[m]
            n_known += 1
        bits[m] = bit
    return known[:n_known], bits, n_kept


@njit(cache=True, error_model="numpy")
def _matters(rectangle: Floats) -> bool:
    """Return whether a silhouette ``(4,)`` covers more than a negligible part of the energy."""
    root = _ROOT_BANDS[0]
    covered = _below(root * rectangle[1]) - _below(root * rectangle[0])
    covered *= _below(root * rectangle[3]) - _below(root * rectangle[2])
    if covered > NEGLIGIBLE / 50.0:
        return True
    is_beside = rectangle[0] > 0.0 or rectangle[1] < 0.0
    return not (is_beside or rectangle[2] > 0.0 or rectangle[3] < 0.0)


@njit(cache=True, error_model="numpy")
def _sorted(rectangles: Floats, n: int, first: int) -> Floats:
    """Return the edges ``(2 n,)`` of the first n silhouettes in two columns, in order."""
    edges = np.empty(2 * n)
    for m in range(2 * n):
        edge, at = rectangles[m // 2, first + m % 2], m
        while at > 0 and edges[at - 1] > edge:
            edges[at] = edges[at - 1]
            at -= 1
        edges[at] = edge
    return edges


@njit(cache=True, error_model="numpy")
def _index(edges: Floats, edge: float) -> int:
    """Return the position of the first of equal edges."""
    m = 0
    while edges[m] < edge:
        m += 1
    return m


@njit(cache=True, error_model="numpy")
def _below(nu: float) -> float:
    """Return the fraction of the energy on the side of an edge below it, F in the module."""
    return 0.5 * (1.0 + nu / math.sqrt(nu * nu + _SPREAD))


@njit(cache=True, error_model="numpy")
def _measures(edges: Floats) -> Floats:
    """Return the measures of the intervals between edges ``(m,)``, ``(m + 1, N_BANDS)``."""
    measures = np.empty((len(edges) + 1, N_BANDS))
    for band in range(N_BANDS):
        last = 0.0
        for m in range(len(edges)):
            below = _below(_ROOT_BANDS[band] * edges[m])
            measures[m, band] = below - last
            last = below
        measures[len(edges), band] = 1.0 - last
    return measures


@njit(cache=True, error_model="numpy")
def _energy_through_all(
    mask: int,
    known: NDArray[np.int64],
    screens: Screens,
    surface_ratio: float,
    energy: Floats,
) -> None:
    """Write the energy ``(N_BANDS,)`` that passes the screens of a mask one after another."""
    solid = np.empty(len(known), np.int64)
    n_solid = 0
    for bit in range(len(known)):
        if (mask >> bit) & 1:
            solid[n_solid] = known[bit]
            n_solid += 1
    gaps = np.empty(max(n_solid - 1, 0))
    for n in range(n_solid - 1):
        gaps[n] = gap_between(screens, solid[n], solid[n + 1])
    energy_through(n_solid, gaps, surface_ratio, energy)


@njit(cache=True, error_model="numpy")
def gap_between(screens: Screens, one: int, other: int) -> float:
    """Return the air between two boxes along an axis of one of them, in metres; 0 if they touch."""
    greatest = 0.0
    for box in (one, other):
        for k in range(3):
            apart = reach = 0.0
            for j in range(3):
                axis = screens.rotations[box, j, k]
                apart += axis * (screens.centres[other, j] - screens.centres[one, j])
            for each in (one, other):
                for m in range(3):
                    along = 0.0
                    for j in range(3):
                        along += screens.rotations[box, j, k] * screens.rotations[each, j, m]
                    reach += abs(along) * screens.halves[each, m]
            greatest = max(greatest, abs(apart) - reach)
    return greatest
