"""Boxes that sound has to pass through, at the poses that they have now."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from veca_marl.sim.geometry import Floats

_GRAZE_M = 1e-6


class Obstacles:
    """Boxes between rooms. An owner moves its box by the number that `add` has returned.

    There is nothing to recompute per step: a box costs time only when it is moved, and in the
    paths that are tested against all boxes anyway.
    """

    def __init__(self) -> None:
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
        return len(self._halves) - 1

    def move(self, number: int, centre: ArrayLike, rotation: ArrayLike) -> None:
        """Set the pose of a box.

        Args:
            number: As returned by `add`.
            centre: ``(3,)`` metres, world frame.
            rotation: ``(3, 3)`` from the axes of the box to the world's.
        """
        self._centres[number] = centre
        self._rotations[number] = rotation

    def between(self, one: Floats, other: Floats) -> int:
        """Return how many boxes the straight line between two points ``(3,)`` passes through."""
        return int(_count_crossed(one, other, self._centres, self._rotations, self._halves))


@njit(cache=True)
def _count_crossed(
    one: Floats, other: Floats, centres: Floats, rotations: Floats, halves: Floats
) -> int:
    """Count the boxes that a segment passes through (slab test: Kay & Kajiya, SIGGRAPH 1986).

    Args:
        one: ``(3,)`` metres, one end of the segment.
        other: ``(3,)`` metres, its other end.
        centres: ``(n, 3)`` metres.
        rotations: ``(n, 3, 3)`` from the axes of the boxes to the world's.
        halves: ``(n, 3)`` metres.
    """
    length = np.sqrt(((other - one) ** 2).sum())
    count = 0
    for n in range(len(centres)):
        enter, leave = 0.0, 1.0
        for axis in range(3):
            begin = way = 0.0
            for k in range(3):
                begin += (one[k] - centres[n, k]) * rotations[n, k, axis]
                way += (other[k] - one[k]) * rotations[n, k, axis]
            half = halves[n, axis]
            if abs(way) < 1e-12:
                if abs(begin) > half - _GRAZE_M:
                    leave = -1.0
                continue
            first, second = (-half - begin) / way, (half - begin) / way
            enter = max(enter, min(first, second))
            leave = min(leave, max(first, second))
        if (leave - enter) * length > _GRAZE_M:
            count += 1
    return count
