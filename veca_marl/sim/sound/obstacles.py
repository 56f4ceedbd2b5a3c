"""Boxes that sound has to pass through, at the poses that they have now."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.blocked_paths import any_extends_into, count_crossed, count_crossed_inside
from veca_marl.sim.sound.room_acoustics import Room
from veca_marl.sim.sound.rooms.leaf_paths import Boxes, count_leaves, count_leaves_inside


class Obstacles:
    """Boxes that attenuate sound. An owner moves its box by the number that `add` has returned.

    Leaves of doors are numbered apart: they attenuate only what goes through the openings that they
    close, see `leaf_paths`.

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
