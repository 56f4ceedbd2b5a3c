"""Free floor of a room as a grid: which cells a body of some radius reaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.physics.houses.floor_division import Rectangle

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
