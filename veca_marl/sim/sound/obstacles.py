"""Obstacles to sound: walls and furniture as boxes, and the leaves of doors.

What they take from a sound is the matter of `diffraction` and `partitions`. Here are their poses,
and how many of them a straight line passes: a leaf counts only for a line that passes it now and
would pass it closed, since an open leaf is a free panel with air all round it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.blocked_paths import (
    contains_point,
    count_crossed,
    crosses_box,
    stretch_in_box,
)
from veca_marl.sim.sound.screens import Boxes, ScreenSets, find_screens

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

    def screens(self, lower: Floats, upper: Floats) -> ScreenSets:
        """Return where and how they attenuate sound in rooms, see `find_screens`."""
        boxes = self._boxes.arrays, self._leaves.arrays, self._closed.arrays
        return find_screens(*boxes, lower, upper)


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
