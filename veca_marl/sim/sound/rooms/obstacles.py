"""Boxes that sound has to pass through, at the poses that they have now."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.rooms.acoustics import Room
from veca_marl.sim.sound.rooms.blocked_paths import (
    any_extends_into,
    count_crossed,
    count_crossed_inside,
)


class Obstacles:
    """Boxes that attenuate sound. An owner moves its box by the number that `add` has returned.

    Attributes:
        changes: How many times a box was added, or moved to another pose.
    """

    def __init__(self) -> None:
        self.changes = 0
        self._centres, self._halves = np.zeros((0, 3)), np.zeros((0, 3))
        self._rotations = np.zeros((0, 3, 3))

    def __len__(self) -> int:
        return len(self._centres)

    def add(self, half: ArrayLike) -> int:
        """Add a box at the origin and return its number.

        Args:
            half: ``(3,)`` metres, half of its edges.

        Raises:
            ValueError: If these are not three positive, finite lengths.
        """
        halves = np.asarray(half, dtype=np.float64)
        if halves.shape != (3,) or not ((halves > 0.0) & np.isfinite(halves)).all():
            raise ValueError(f"half={half!r}: must be three positive, finite lengths in metres")
        self._halves = np.vstack([self._halves, halves])
        self._centres = np.vstack([self._centres, np.zeros(3)])
        self._rotations = np.concatenate([self._rotations, np.eye(3)[None]])
        self.changes += 1
        return len(self._halves) - 1

    def move(self, number: int, centre: ArrayLike, rotation: ArrayLike) -> None:
        """Set the pose of a box. The pose that it has already is not counted as a change.

        Args:
            number: As returned by `add`.
            centre: ``(3,)`` metres, world frame.
            rotation: ``(3, 3)`` from the axes of the box to the world's.
        """
        pose = np.asarray(centre, np.float64), np.asarray(rotation, np.float64)
        # bytes are compared faster than arrays
        stored = self._centres[number].tobytes() + self._rotations[number].tobytes()
        if stored == pose[0].tobytes() + pose[1].tobytes():
            return
        self._centres[number], self._rotations[number] = pose
        self.changes += 1

    def between(self, one: Floats, other: Floats) -> int:
        """Return how many boxes the straight line between two points ``(3,)`` passes through.

        Boxes round one of the points do not count.
        """
        return int(count_crossed(one, other, self._centres, self._rotations, self._halves))

    def reach_into(self, room: Room) -> bool:
        """Return whether any box is inside a room, not only next to it."""
        return bool(
            any_extends_into(self._centres, self._rotations, self._halves, room.lower, room.size)
        )

    def inside(
        self,
        room: Room,
        bounds: tuple[Floats, Floats],
        lattice: NDArray[np.int64],
        source: Floats,
        head: Floats,
    ) -> NDArray[np.int64]:
        """Return how many boxes in a room each path inside it passes, see `count_crossed_inside`.

        Args:
            room: The room.
            bounds: Its `Room.bounds`.
            lattice: ``(K, 3)`` reflections of the paths, from `image_lattice`.
            source: ``(3,)`` metres.
            head: ``(3,)`` metres.
        """
        boxes = self._centres, self._rotations, self._halves
        return count_crossed_inside(source, head, bounds, room.lower, room.size, lattice, *boxes)
