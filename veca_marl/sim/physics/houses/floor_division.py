"""Division of a rectangle into rooms, and the free floor of a room as a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from veca_marl.sim.geometry import Bools, Floats

_JITTER = 0.2  # relative deviation of a part's length from its share
_ROUNDING_M = 1e-5  # above the sum of the errors by which parts are rounded


class Rectangle(NamedTuple):
    """A rectangle of the floor plan.

    Attributes:
        lower_m: The least x and y.
        size_m: The extent along x and y.
    """

    lower_m: tuple[float, float]
    size_m: tuple[float, float]

    def part(self, axis: int, begin_m: float, length_m: float) -> Rectangle:
        """Return the part from `begin_m` after the lower edge, `length_m` long along an axis."""
        lower, size = list(self.lower_m), list(self.size_m)
        lower[axis], size[axis] = round(lower[axis] + begin_m, 6), round(length_m, 6)
        return Rectangle((lower[0], lower[1]), (size[0], size[1]))


class Limits(NamedTuple):
    """What every division keeps.

    Attributes:
        least_m: Least side of a room.
        wall_m: Thickness of the walls between rooms.
    """

    least_m: float
    wall_m: float

    def rows(self, length_m: float) -> int:
        """Return how many rooms fit in a row of a length."""
        return int((length_m + self.wall_m + _ROUNDING_M) / (self.least_m + self.wall_m))

    def capacity(self, size_m: tuple[float, float]) -> int:
        """Return the number of rooms into which every division of a rectangle is possible."""
        return self.rows(size_m[0]) * self.rows(size_m[1])

    def length_m(self, rows: int) -> float:
        """Return the least length of a row of rooms."""
        return rows * self.least_m + (rows - 1) * self.wall_m


class _Cut(NamedTuple):
    """A possible division: `rows` rows and `rooms` rooms of the rectangle go to the first part."""

    axis: int
    rows: int
    rooms: int


def divide(
    whole: Rectangle, weights: Sequence[float], limits: Limits, rng: np.random.Generator
) -> list[Rectangle]:
    """Divide a rectangle into one room for each weight.

    The rectangle is cut in two across its longer side where possible, about in proportion to the
    weights of either part, then each part likewise. No room is narrower than the limit.

    Args:
        whole: The rectangle.
        weights: Relative areas of the rooms.
        limits: Least side and thickness of walls.
        rng: Source of the proportions.

    Raises:
        ValueError: If more rooms are asked for than `Limits.capacity`.
    """
    if len(weights) > limits.capacity(whole.size_m):
        raise ValueError(f"{whole.size_m} m hold {limits.capacity(whole.size_m)} rooms at most")
    if len(weights) == 1:
        return [whole]
    cut = _cut(whole, len(weights), limits, rng)
    length_m = whole.size_m[cut.axis]
    share = sum(weights[: cut.rooms]) / sum(weights)
    wanted_m = share * (1.0 + rng.uniform(-_JITTER, _JITTER)) * (length_m - limits.wall_m)
    others = limits.rows(length_m) - cut.rows
    greatest_m = length_m - limits.wall_m - limits.length_m(others)
    first_m = min(max(round(wanted_m, 2), limits.length_m(cut.rows)), greatest_m)
    second_m = first_m + limits.wall_m
    return [
        *divide(whole.part(cut.axis, 0.0, first_m), weights[: cut.rooms], limits, rng),
        *divide(
            whole.part(cut.axis, second_m, length_m - second_m), weights[cut.rooms :], limits, rng
        ),
    ]


def _cut(whole: Rectangle, rooms: int, limits: Limits, rng: np.random.Generator) -> _Cut:
    """Draw a cut that leaves each part the capacity that it needs, as even as possible."""
    longer = int(whole.size_m[1] > whole.size_m[0])
    for axis in (longer, 1 - longer):
        along, across = limits.rows(whole.size_m[axis]), limits.rows(whole.size_m[1 - axis])
        cuts = [
            _Cut(axis, rows, first)
            for rows in range(1, along)
            for first in range(1, rooms)
            if first <= rows * across and rooms - first <= (along - rows) * across
        ]
        if cuts:
            even = min(abs(2 * cut.rooms - rooms) for cut in cuts)
            best = [cut for cut in cuts if abs(2 * cut.rooms - rooms) == even]
            return best[int(rng.integers(len(best)))]
    raise ValueError(f"{whole.size_m} m cannot be divided into {rooms} rooms")


CELL_M = 0.05


class FreeFloor:
    """Distances of the floor's points from walls and obstacles.

    Args:
        room: The floor; walls are all round it.
        obstacles: Rectangles with sides along x and y.

    Attributes:
        clearance_m: ``(nx, ny)`` distance of the centre of each cell from the nearest wall or
            obstacle, at most one cell too small; 0 in obstacles.
    """

    def __init__(self, room: Rectangle, obstacles: Sequence[Rectangle]) -> None:
        self._room = room
        shape = [max(1, round(length / CELL_M)) for length in room.size_m]
        free = np.ones(shape, np.bool_)
        for obstacle in obstacles:
            free[self._cells(obstacle)] = False
        padded = np.pad(free, 1)
        steps: Floats = ndimage.distance_transform_edt(padded)
        self.clearance_m: Floats = np.maximum(steps[1:-1, 1:-1] - 0.5, 0.0) * CELL_M

    def _cells(self, obstacle: Rectangle) -> tuple[slice, slice]:
        """Return the cells that an obstacle covers, also partly."""
        low = (np.array(obstacle.lower_m) - self._room.lower_m) / CELL_M
        high = low + np.array(obstacle.size_m) / CELL_M
        first, end = np.floor(low + 1e-6).astype(int), np.ceil(high - 1e-6).astype(int)
        first = np.maximum(first, 0)
        return slice(int(first[0]), max(int(end[0]), 0)), slice(int(first[1]), max(int(end[1]), 0))

    def cell(self, point: tuple[float, float]) -> tuple[int, int]:
        """Return the cell that contains a point, or the nearest one."""
        place = (np.array(point) - self._room.lower_m) / CELL_M
        column, row = np.clip(place.astype(int), 0, np.array(self.clearance_m.shape) - 1)
        return int(column), int(row)

    def connects(self, points: Sequence[tuple[float, float]], radius_m: float) -> bool:
        """Return whether a disc reaches all places that have space for it, and these points."""
        free: Bools = self.clearance_m >= radius_m
        _, count = ndimage.label(free)
        return count == 1 and all(free[self.cell(point)] for point in points)

    def open_extent_m(self, clear_m: float) -> float:
        """Return the distance of two opposite corners of the box round all places so clear."""
        places: NDArray[np.int64] = np.argwhere(self.clearance_m >= clear_m)
        if not len(places):
            return 0.0
        return float(np.linalg.norm(np.ptp(places, axis=0))) * CELL_M


@dataclass(frozen=True)
class FloorNeeds:
    """What furniture and open leaves of doors leave free.

    Attributes:
        radii_m: Radii of bodies that reach all places with space for them, and all doors.
        clear_m: Distance from walls and furniture that counts as open floor.
        extent_m: Least extent of the open floor.
    """

    radii_m: tuple[float, ...] = (0.12, 0.3)
    clear_m: float = 0.85
    extent_m: float = 1.2

    def are_met(self, floor: FreeFloor, fronts: Sequence[tuple[float, float]]) -> bool:
        """Return whether a floor is open, and the points in front of its doors are reached."""
        if floor.open_extent_m(self.clear_m) < self.extent_m:
            return False
        return all(floor.connects(fronts, radius_m) for radius_m in self.radii_m)
