"""Shortest paths over the floor, round furniture and given discs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from veca_marl.envs.tasks.navigation.floors.floor_grid import CELL_M, FloorGrid
from veca_marl.sim.geometry import Bools, Floats

_BLOCKED_COST = 1000.0  # a path crosses blocked cells only where it starts or ends in them
_LOOK_AHEAD_M = 1.5
# to the neighbours on one side; the other side has the same edges backwards
_NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1))


class PathsTo:
    """Shortest paths from everywhere to one goal, over the free cells of a grid (Dijkstra 1959).

    A start or goal in a blocked cell is possible: the path takes the shortest way out of the
    blocked cells.

    Args:
        grid: The cells.
        free: Which of them are free, ``(nx, ny)``.
        goal: ``(2,)`` or ``(3,)`` metres.
    """

    def __init__(self, grid: FloorGrid, free: Bools, goal: Floats) -> None:
        self._grid, self._free = grid, free
        self._goal = np.array([goal[0], goal[1]], float)
        self._centres = grid.centres.reshape(-1, 2)
        costs, self._next = dijkstra(
            _edges(free), directed=False, indices=self._number(goal), return_predecessors=True
        )
        self._costs: Floats = costs

    def length_m(self, place: Floats) -> float:
        """Return the length of the path from a place; above 100 m if it crosses blocked cells."""
        return float(self._costs[self._number(place)])

    def next_point(self, place: Floats) -> Floats:
        """Return the farthest point of the path that can be reached straight.

        Args:
            place: ``(2,)`` or ``(3,)`` metres.

        Returns:
            ``(2,)`` metres: at most 1.5 m away along the path, or the goal.
        """
        here, cell = np.array([place[0], place[1]]), self._number(place)
        point = self._goal
        for step in range(1, math.ceil(_LOOK_AHEAD_M / CELL_M)):
            cell = int(self._next[cell])
            if cell < 0:
                return self._goal if self._is_straight(here, self._goal) else point
            centre = self._centres[cell]
            if step > 1 and not self._is_straight(here, centre):
                break
            point = centre
        return point

    def _number(self, place: Floats) -> int:
        x, y = self._grid.cell_of(place)
        return x * self._grid.shape[1] + y

    def _is_straight(self, start: Floats, end: Floats) -> bool:
        """Return whether the cells between two points are free; those of the start do not count."""
        count = max(1, math.ceil(math.dist(start, end) / (0.5 * CELL_M)))
        shares = np.arange(2, count) / count
        cells = (self._grid.cell_of(start + share * (end - start)) for share in shares)
        return all(self._free[cell] for cell in cells)


def _edges(free: Bools) -> csr_array:
    """Return the graph of the cells: lengths in metres between neighbours, eight for each cell."""
    numbers = np.arange(free.size).reshape(free.shape)
    cost = np.where(free, 1.0, _BLOCKED_COST)
    rows: list[NDArray[np.int64]] = []
    columns: list[NDArray[np.int64]] = []
    lengths: list[Floats] = []
    for dx, dy in _NEIGHBOURS:
        one = slice(0, free.shape[0] - dx), slice(max(0, -dy), free.shape[1] - max(0, dy))
        other = slice(dx, free.shape[0]), slice(max(0, dy), free.shape[1] + min(0, dy))
        rows.append(numbers[one].ravel())
        columns.append(numbers[other].ravel())
        lengths.append((math.hypot(dx, dy) * CELL_M * np.maximum(cost[one], cost[other])).ravel())
    entries = np.concatenate(lengths), (np.concatenate(rows), np.concatenate(columns))
    return csr_array(entries, shape=(free.size, free.size))
