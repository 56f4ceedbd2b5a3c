"""Obstacles to sound: walls and furniture as boxes, and the leaves of doors.

A leaf attenuates what goes through the opening that it closes. Elsewhere it is a free panel in
front of a wall, in a wall, or in a room, with air all round it: the screen of 1 x 2 m of an open
leaf takes a few dB by diffraction (Maekawa 1968), not the loss of a partition. So a leaf attenuates
a path only if this passes the leaf now and would pass it closed: an open door never attenuates more
than a closed one.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.blocked_paths import (
    any_extends_into,
    contains_point,
    count_crossed,
    count_crossed_inside,
    crosses_box,
    extends_into,
    folded_paths,
    polygon_crosses,
    stretch_in_box,
    within_bounds,
)
from veca_marl.sim.sound.room_acoustics import Room

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


class Obstacles:
    """Boxes that attenuate sound. An owner moves its box by the number that `add` has returned.

    Leaves of doors are numbered apart: they attenuate only what goes through the openings that they
    close, see `count_leaves`.

    Attributes:
        changes: How many times a box was added, or moved to another pose.
    """

    def __init__(self) -> None:
        self.changes = 0
        self._boxes, self._leaves, self._closed = _Boxes(), _Boxes(), _Boxes()

    def __len__(self) -> int:
        return len(self._boxes) + len(self._leaves)

    def add(self, half: ArrayLike) -> int:
        """Add a box at the origin and return its number.

        Args:
            half: ``(3,)`` metres, half of its edges.

        Raises:
            ValueError: If these are not three positive, finite lengths.
        """
        number = self._boxes.add(half)
        self.changes += 1
        return number

    def add_leaf(self, half: ArrayLike) -> int:
        """Add the closed leaf of a door at the origin and return its number among the leaves.

        Args:
            half: ``(3,)`` metres, half of its edges.

        Raises:
            ValueError: If these are not three positive, finite lengths.
        """
        self._closed.add(half)
        number = self._leaves.add(half)
        self.changes += 1
        return number

    def move(self, number: int, centre: ArrayLike, rotation: ArrayLike) -> None:
        """Set the pose of a box. The pose that it has already is not counted as a change.

        Args:
            number: As returned by `add`.
            centre: ``(3,)`` metres, world frame.
            rotation: ``(3, 3)`` from the axes of the box to the world's.
        """
        self.changes += self._boxes.move(number, centre, rotation)

    def move_leaf(self, number: int, centre: ArrayLike, rotation: ArrayLike) -> None:
        """Set the pose of a leaf, as `move` does.

        Args:
            number: As returned by `add_leaf`.
            centre: ``(3,)`` metres, world frame.
            rotation: ``(3, 3)`` from the axes of the leaf to the world's.
        """
        self.changes += self._leaves.move(number, centre, rotation)

    def move_opening(self, number: int, centre: ArrayLike, rotation: ArrayLike) -> None:
        """Set the pose that a leaf has when it is closed; see `move_leaf`."""
        self.changes += self._closed.move(number, centre, rotation)

    def between(self, one: Floats, other: Floats) -> int:
        """Return how many obstacles the straight line between two points ``(3,)`` passes through.

        Those round one of the points do not count.
        """
        walls = self._boxes.arrays
        count = int(count_crossed(one, other, *walls))
        if len(self._leaves):
            leaves, closed = self._leaves.arrays, self._closed.arrays
            count += int(count_leaves(one, other, walls, leaves, closed))
        return count

    def reach_into(self, room: Room) -> bool:
        """Return whether any box, or a closed leaf, is inside a room, not only next to it."""
        return any(
            any_extends_into(*boxes.arrays, room.lower, room.size)
            for boxes in (self._boxes, self._closed)
        )

    def inside(
        self,
        room: Room,
        bounds: tuple[Floats, Floats],
        lattice: NDArray[np.int64],
        source: Floats,
        head: Floats,
    ) -> NDArray[np.int64]:
        """Return how many obstacles in a room each path inside it passes.

        See `count_crossed_inside` and `count_leaves_inside`.

        Args:
            room: The room.
            bounds: Its `Room.bounds`.
            lattice: ``(K, 3)`` reflections of the paths, from `image_lattice`.
            source: ``(3,)`` metres.
            head: ``(3,)`` metres.
        """
        paths = source, head, bounds, room.lower, room.size, lattice
        walls = self._boxes.arrays
        counts: NDArray[np.int64] = count_crossed_inside(*paths, *walls)
        if any_extends_into(*self._closed.arrays, room.lower, room.size):
            leaves, closed = self._leaves.arrays, self._closed.arrays
            counts = counts + count_leaves_inside(*paths, walls, leaves, closed)
        return counts


class _Boxes:
    """Boxes of constant size and their poses.

    Attributes:
        arrays: Centres, rotations and halves of edges of all of them.
    """

    def __init__(self) -> None:
        self.arrays: Boxes = np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3))

    def __len__(self) -> int:
        return len(self.arrays[0])

    def add(self, half: ArrayLike) -> int:
        """Add a box at the origin and return its number, see `Obstacles.add`."""
        new = np.asarray(half, dtype=np.float64)
        if new.shape != (3,) or not ((new > 0.0) & np.isfinite(new)).all():
            raise ValueError(f"half={half!r}: must be three positive, finite lengths in metres")
        centres, rotations, halves = self.arrays
        self.arrays = (
            np.vstack([centres, np.zeros(3)]),
            np.concatenate([rotations, np.eye(3)[None]]),
            np.vstack([halves, new]),
        )
        return len(halves)

    def move(self, number: int, centre: ArrayLike, rotation: ArrayLike) -> bool:
        """Set the pose of a box; return whether it had another one, see `Obstacles.move`."""
        centres, rotations, _ = self.arrays
        pose = np.asarray(centre, np.float64), np.asarray(rotation, np.float64)
        # bytes are compared faster than arrays
        stored = centres[number].tobytes() + rotations[number].tobytes()
        if stored == pose[0].tobytes() + pose[1].tobytes():
            return False
        centres[number], rotations[number] = pose
        return True
