"""Which paths of sound pass through the leaves of doors.

A leaf attenuates what goes through the opening that it closes. Elsewhere it is a free panel in
front of a wall, in a wall, or in a room, with air all round it: the screen of 1 x 2 m of an open
leaf takes a few dB by diffraction (Maekawa 1968), not the loss of a partition. So a leaf attenuates
a path only if this passes the leaf now and would pass it closed: an open door never attenuates more
than a closed one.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.blocked_paths import (
    contains_point,
    crosses_box,
    extends_into,
    folded_paths,
    polygon_crosses,
    stretch_in_box,
    within_bounds,
)

Boxes = tuple[Floats, Floats, Floats]
"""Centres ``(n, 3)``, rotations ``(n, 3, 3)`` and halves of edges ``(n, 3)`` of boxes, see
`blocked_paths`."""

_FRAME_M = 0.05
"""With less air than that between them, the closed leaf and a wall that a path passes are one
partition: oblique paths pass the frame and the edge of the leaf."""


@njit(cache=True)
def count_leaves(one: Floats, other: Floats, walls: Boxes, leaves: Boxes, closed: Boxes) -> int:
    """Return how many leaves attenuate the sound along a segment, in addition to the walls.

    Leaves round one of its ends are left out, as in `count_crossed`.

    Args:
        one: ``(3,)`` metres, one end of the segment.
        other: ``(3,)`` metres, its other end.
        walls: All obstacles that are not leaves.
        leaves: The leaves where they are now.
        closed: The leaves where they would be if they were closed.
    """
    count = 0
    for n in range(len(leaves[0])):
        leaf = leaves[0][n], leaves[1][n], leaves[2][n]
        if not crosses_box(one, other, *leaf):
            continue
        if contains_point(one, *leaf) or contains_point(other, *leaf):
            continue
        count += _passes_opening(one, other, closed[0][n], closed[1][n], closed[2][n], walls)
    return count


@njit(cache=True)
def count_leaves_inside(
    source: Floats,
    head: Floats,
    bounds: tuple[Floats, Floats],
    lower: Floats,
    size: Floats,
    lattice: NDArray[np.int64],
    walls: Boxes,
    leaves: Boxes,
    closed: Boxes,
) -> NDArray[np.int64]:
    """Return how many leaves attenuate each path inside a room, in addition to the walls.

    The leaves of doors between rooms attenuate none of them: their openings are outside.

    Args:
        source: See `count_crossed_inside`.
        head: Likewise.
        bounds: Likewise.
        lower: Likewise.
        size: Likewise.
        lattice: Likewise.
        walls: See `count_leaves`.
        leaves: Likewise.
        closed: Likewise.

    Returns:
        ``(K,)``.
    """
    counts = np.zeros(len(lattice), np.int64)
    begin, end = within_bounds(source, bounds), within_bounds(head, bounds)
    for n in range(len(leaves[0])):
        shut = closed[0][n], closed[1][n], closed[2][n]
        if not extends_into(*shut, lower, size):
            continue
        leaf = leaves[0][n], leaves[1][n], leaves[2][n]
        if contains_point(begin, *leaf) or contains_point(end, *leaf):
            continue
        corners, n_corners = folded_paths(begin, end, lower, size, lattice)
        for k in range(len(lattice)):
            path = corners[k, : n_corners[k]]
            if polygon_crosses(path, *leaf):
                counts[k] += _polygon_passes_opening(path, *shut, walls)
    return counts


@njit(cache=True)
def _polygon_passes_opening(
    corners: Floats, centre: Floats, rotation: Floats, half: Floats, walls: Boxes
) -> bool:
    """Return whether a segment between corners ``(n, 3)`` does, see `_passes_opening`."""
    for n in range(len(corners) - 1):
        if _passes_opening(corners[n], corners[n + 1], centre, rotation, half, walls):
            return True
    return False


@njit(cache=True)
def _passes_opening(
    one: Floats, other: Floats, centre: Floats, rotation: Floats, half: Floats, walls: Boxes
) -> bool:
    """Return whether a segment passes a closed leaf and no wall beside it.

    Args:
        one: ``(3,)`` metres, one end of the segment.
        other: ``(3,)`` metres, its other end.
        centre: ``(3,)`` metres, of the closed leaf.
        rotation: ``(3, 3)`` from its axes to the world's.
        half: ``(3,)`` metres, half of its edges.
        walls: See `count_leaves`.
    """
    if not crosses_box(one, other, centre, rotation, half):
        return False
    enter, leave = stretch_in_box(one, other, centre, rotation, half)
    for n in range(len(walls[0])):
        wall = walls[0][n], walls[1][n], walls[2][n]
        if not crosses_box(one, other, *wall):
            continue
        if contains_point(one, *wall) or contains_point(other, *wall):
            continue
        begin, end = stretch_in_box(one, other, *wall)
        if begin < leave + _FRAME_M and end > enter - _FRAME_M:
            return False
    return True
