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
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound.partitions import BANDS_HZ, N_BANDS, energy_through
from veca_marl.sim.sound.silhouettes import BOX, LEAF, MOST_MOVING, MOST_SETS, Screens, Work

NEGLIGIBLE = 0.05
"""An obstacle that takes less than this fraction of the energy takes none (0.2 dB); the rest is
divided by one minus it, so that energy stays continuous."""

_SPREAD = 0.4  # of F: 10 lg(20 N) far in the shadow
_MOST = 62  # silhouettes of one path; they are bits of an integer
_NOTHING = 1e-9  # measure
_ROOT_BANDS: Floats = np.sqrt(BANDS_HZ)


@kernel
def energy_past(
    count: int, screens: Screens, surface_ratio: float, work: Work, energy: Floats
) -> None:
    """Write the fraction of the energy that arrives in each octave band.

    A closed leaf and the wall round it are one screen. An open leaf stands apart from its opening:
    sound passes both one after another. Between these the level changes linearly with the openness
    of the leaf: the channel that a leaf opens at its frame is no straight way through it. Where
    there are several, the level is linear in the openness of each: the mean over all combinations
    of closed and open ones, each with its share.

    Args:
        count: How many silhouettes there are.
        screens: All screens.
        surface_ratio: See `partitions.energy_through`.
        work: Has the silhouettes; the rest is overwritten.
        energy: ``(N_BANDS,)``, overwritten.
    """
    count = _keep_those_that_matter(count, work)
    energy[:] = 1.0
    if count == 0:
        return
    n_moving = _find_moving(count, screens, work)
    for combination in range(1 << n_moving):
        share = 1.0
        for k in range(n_moving):
            opens = screens.opens[work.moving[k]]
            share *= 1.0 - opens if (combination >> k) & 1 else opens
        n_chosen = _choose_closed(count, n_moving, combination, screens, work)
        _write_composite(n_chosen, screens, surface_ratio, work)
        _multiply(energy, share, work)
    for m in range(count):
        number = work.numbers[m]
        if screens.kinds[number] == LEAF and not _contains(work.numbers, m, number):
            n_chosen = 0
            for other in range(m, count):
                if work.numbers[other] == number:
                    work.chosen[n_chosen] = other
                    n_chosen += 1
            if screens.opens[number] > 0.0:
                _write_composite(n_chosen, screens, surface_ratio, work)
                _multiply(energy, screens.opens[number], work)


@kernel
def _find_moving(count: int, screens: Screens, work: Work) -> int:
    """Write the leaves among the silhouettes that are neither open nor closed; return how many."""
    n_moving = 0
    for m in range(count):
        number = work.numbers[m]
        is_known = _index_of_leaf(screens.leaves[number], n_moving, screens, work) >= 0
        if 0.0 < screens.opens[number] < 1.0 and not is_known and n_moving < MOST_MOVING:
            work.moving[n_moving] = number
            n_moving += 1
    return n_moving


@kernel
def _index_of_leaf(leaf: int, n_moving: int, screens: Screens, work: Work) -> int:
    """Return the index of a leaf in `Work.moving`, -1 if it is not there."""
    index = -1
    for k in range(n_moving):
        if screens.leaves[work.moving[k]] == leaf:
            index = k
    return index


@kernel
def _choose_closed(
    count: int, n_moving: int, combination: int, screens: Screens, work: Work
) -> int:
    """Choose boxes and closed leaves; return how many these are.

    Args:
        count: How many silhouettes there are.
        n_moving: How many leaves are neither open nor closed.
        combination: Which of these count as closed, one bit for each.
        screens: All screens.
        work: See `energy_past`.
    """
    n_chosen = 0
    for m in range(count):
        number = work.numbers[m]
        if screens.kinds[number] == LEAF:
            continue
        index = _index_of_leaf(screens.leaves[number], n_moving, screens, work)
        is_closed = (combination >> index) & 1 == 1 if index >= 0 else screens.opens[number] < 0.5
        if screens.kinds[number] == BOX or is_closed:
            work.chosen[n_chosen] = m
            n_chosen += 1
    return n_chosen


@kernel
def _multiply(energy: Floats, share: float, work: Work) -> None:
    """Multiply energies by those of the last composite, to the power of its share."""
    for band in range(N_BANDS):
        factor = work.part[0, band]
        energy[band] *= factor if share == 1.0 else factor**share


@kernel
def _keep_those_that_matter(count: int, work: Work) -> int:
    """Move the silhouettes that matter to the front, those at the least depth first.

    Writes `Work.below` for these.

    Returns:
        How many there are.
    """
    rectangles, numbers, depths = work.rectangles, work.numbers, work.depths
    below, n_kept = work.below, 0
    for m in range(count):
        if not _matters(rectangles[m]):
            continue
        left, right = rectangles[m, 0], rectangles[m, 1]
        low, high = rectangles[m, 2], rectangles[m, 3]
        number, depth, at = numbers[m], depths[m], n_kept
        while at > 0 and depths[at - 1] > depth:
            for side in range(4):
                rectangles[at, side] = rectangles[at - 1, side]
            numbers[at], depths[at] = numbers[at - 1], depths[at - 1]
            at -= 1
        rectangles[at, 0], rectangles[at, 1] = left, right
        rectangles[at, 2], rectangles[at, 3] = low, high
        numbers[at], depths[at] = number, depth
        n_kept += 1
    n_kept = min(n_kept, _MOST)
    for m in range(n_kept):
        for side in range(4):
            square = rectangles[m, side] ** 2
            half = 0.5 if rectangles[m, side] >= 0.0 else -0.5
            for band in range(N_BANDS):
                each = square * BANDS_HZ[band]
                below[m, side, band] = 0.5 + half * math.sqrt(each / (each + _SPREAD))
    return n_kept


@kernel
def _matters(rectangle: Floats) -> bool:
    """Return whether a silhouette ``(4,)`` covers more than a negligible part of the energy."""
    root = _ROOT_BANDS[0]
    covered = _below(root * rectangle[1]) - _below(root * rectangle[0])
    covered *= _below(root * rectangle[3]) - _below(root * rectangle[2])
    if covered > NEGLIGIBLE / 50.0:
        return True
    is_beside = rectangle[0] > 0.0 or rectangle[1] < 0.0
    return not (is_beside or rectangle[2] > 0.0 or rectangle[3] < 0.0)


@kernel
def _below(nu: float) -> float:
    """Return the fraction of the energy on the side of an edge below it, F in the module."""
    return 0.5 * (1.0 + nu / math.sqrt(nu * nu + _SPREAD))


@kernel
def add_measure(rectangle: Floats, weight: float, measures: Floats) -> None:
    """Add the measure ``(N_BANDS,)`` of a silhouette ``(4,)``, multiplied by a weight."""
    for band in range(N_BANDS):
        root = _ROOT_BANDS[band]
        width = _below(root * rectangle[1]) - _below(root * rectangle[0])
        height = _below(root * rectangle[3]) - _below(root * rectangle[2])
        measures[band] += weight * width * height


@kernel
def _write_composite(n: int, screens: Screens, surface_ratio: float, work: Work) -> None:
    """Write the energy that passes the n chosen silhouettes, in one plane, to ``part[0]``.

    The plane is gone through in columns between two edges, and each of these from below: what
    covers a cell is the set of silhouettes whose lower edge was passed, but not their upper one.
    """
    part, ordered, edges = work.part, work.ordered, work.edges
    masks, through = work.masks, work.through
    if _cover_nothing(n, work):
        part[0] = 1.0
        return
    part[0] = 0.0
    _sort_edges(n, work)
    n_masks, columns = 0, np.int64(0)
    for i in range(2 * n + 1):
        widest = 0.0
        for band in range(N_BANDS):
            part[2, band] = ordered[0, i + 1, band] - ordered[0, i, band]
            widest = max(widest, part[2, band])
        mask, last = np.int64(0), 0
        for j in range(2 * n + 1 if widest > _NOTHING else 0):
            if j < 2 * n and not (columns >> (edges[1, j] >> 1)) & 1:
                continue
            highest = 0.0
            for band in range(N_BANDS):
                part[3, band] = ordered[1, j + 1, band] - ordered[1, last, band]
                highest = max(highest, part[3, band])
            if highest > _NOTHING:
                known = n_masks - 1
                while known >= 0 and masks[known] != mask:
                    known -= 1
                if known < 0:
                    known = min(n_masks, MOST_SETS - 1)
                    n_masks = known + 1
                    masks[known] = mask
                    _energy_through_all(mask, screens, surface_ratio, work, known)
                for band in range(N_BANDS):
                    part[0, band] += part[2, band] * part[3, band] * through[known, band]
            last = j + 1
            if j < 2 * n:
                mask ^= np.int64(1) << (edges[1, j] >> 1)
        if i < 2 * n:
            columns ^= np.int64(1) << (edges[0, i] >> 1)
    for band in range(N_BANDS):
        part[0, band] = min(part[0, band] / (1.0 - NEGLIGIBLE), 1.0)


@kernel
def _cover_nothing(n: int, work: Work) -> bool:
    """Return whether the n chosen silhouettes together take a negligible part of the energy."""
    below, chosen, covered = work.below, work.chosen, work.part
    for band in range(N_BANDS):
        covered[1, band] = 0.0
    for k in range(n):
        m = chosen[k]
        for band in range(N_BANDS):
            width = below[m, 1, band] - below[m, 0, band]
            covered[1, band] += width * (below[m, 3, band] - below[m, 2, band])
    most = 0.0
    for band in range(N_BANDS):
        most = max(most, covered[1, band])
    return most <= NEGLIGIBLE


@kernel
def _sort_edges(n: int, work: Work) -> None:
    """Sort the edges of the n chosen silhouettes, see `Work.edges` and `Work.ordered`."""
    edges, rectangles, chosen, ordered = work.edges, work.rectangles, work.chosen, work.ordered
    for axis in range(2):
        for m in range(2 * n):
            value, at = rectangles[chosen[m >> 1], 2 * axis + (m & 1)], m
            while at > 0:
                before = edges[axis, at - 1]
                if rectangles[chosen[before >> 1], 2 * axis + (before & 1)] <= value:
                    break
                edges[axis, at] = before
                at -= 1
            edges[axis, at] = m
        for band in range(N_BANDS):
            ordered[axis, 0, band], ordered[axis, 2 * n + 1, band] = 0.0, 1.0
        for i in range(2 * n):
            m, side = chosen[edges[axis, i] >> 1], 2 * axis + (edges[axis, i] & 1)
            for band in range(N_BANDS):
                ordered[axis, i + 1, band] = work.below[m, side, band]


@kernel
def _energy_through_all(
    mask: np.int64, screens: Screens, surface_ratio: float, work: Work, known: int
) -> None:
    """Write the energy that passes the screens of a mask one after another to a row of `through`.

    Args:
        mask: The set, one bit for each chosen silhouette.
        screens: All screens.
        surface_ratio: See `partitions.energy_through`.
        work: Has the silhouettes.
        known: Number of the row.
    """
    if mask == 0:
        work.through[known] = 1.0
        return
    solid, gaps = work.solid, work.gaps
    n_solid = bit = 0
    while mask >> bit:
        number = work.numbers[work.chosen[bit]]
        if (mask >> bit) & 1 and not _contains(solid, n_solid, number):
            if n_solid > 0:
                gaps[n_solid - 1] = gap_between(screens, solid[n_solid - 1], number)
            solid[n_solid] = number
            n_solid += 1
        bit += 1
    energy_through(n_solid, gaps, surface_ratio, work.through[known])


@kernel
def _contains(numbers: NDArray[np.int64], n: int, number: int) -> bool:
    """Return whether a number is one of the first n."""
    found = False
    for m in range(n):
        found = found or numbers[m] == number
    return found


@kernel
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
