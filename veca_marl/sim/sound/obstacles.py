"""Obstacles to sound: walls, furniture and leaves of doors, and their present poses.

Where they end as screens is the matter of `screens`, what they take from a sound that of
`diffraction` and `partitions`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.screens import Boxes, Doorway, ScreenSets, find_screens


class Obstacles:
    """Boxes that attenuate sound. An owner moves its box by the number that `add` has returned.

    Leaves of doors are numbered apart: where they are closed they are one screen with the wall.

    Attributes:
        changes: How many times a box was added, or moved to another pose.
    """

    def __init__(self) -> None:
        self.changes = 0
        self._fixed: list[bool] = []
        self._boxes, self._leaves, self._closed = _Boxes(), _Boxes(), _Boxes()

    def __len__(self) -> int:
        return len(self._boxes) + len(self._leaves)

    def add(self, half: ArrayLike, fixed: bool = True) -> int:
        """Add a box at the origin and return its number.

        Args:
            half: ``(3,)`` metres, half of its edges.
            fixed: Whether it is a wall where it stands between rooms. A box that is not fixed is
                furniture of the nearest room there.

        Raises:
            ValueError: If these are not three positive, finite lengths.
        """
        number = self._boxes.add(half)
        self._fixed.append(fixed)
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

    def screens(self, lower: Floats, upper: Floats, doorways: Sequence[Doorway]) -> ScreenSets:
        """Return where and how they attenuate sound in rooms, see `find_screens`."""
        boxes = self._boxes.arrays, self._leaves.arrays, self._closed.arrays
        return find_screens(*boxes, np.array(self._fixed, bool), lower, upper, doorways)


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
