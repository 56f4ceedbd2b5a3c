"""Shortest paths over a grid of free cells of the floor, round furniture and given discs."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from veca_marl.envs.tasks.floors.places import clearances_m
from veca_marl.sim.geometry import Bools, Floats, Indices
from veca_marl.sim.physics import PlaygroundCfg, Prop, World

CELL_M = 0.1


class FloorGrid(NamedTuple):
    """Square cells that cover all rooms of a playground.

    Attributes:
        lower_m: Corner of the first cell, ``(2,)``.
        shape: Number of cells along x and y.
    """

    lower_m: Floats
    shape: tuple[int, int]

    @property
    def centres(self) -> Floats:
        """Centres of all cells, ``(nx, ny, 2)`` metres."""
        indices = np.moveaxis(np.indices(self.shape), 0, -1)
        centres: Floats = self.lower_m + (indices + 0.5) * CELL_M
        return centres

    def cells_of(self, places: Floats) -> Indices:
        """Return the indices of the cells that contain places, or of the nearest ones.

        Args:
            places: ``(..., 2)`` or ``(..., 3)`` metres.

        Returns:
            ``(..., 2)``.
        """
        cells = np.floor((places[..., :2] - self.lower_m) / CELL_M).astype(np.int64)
        inside: Indices = np.minimum(np.maximum(cells, 0), np.array(self.shape) - 1)
        return inside


class Detour(NamedTuple):
    """A disc that paths lead round.

    Attributes:
        centre: ``(2,)`` or ``(3,)`` metres.
        radius_m: Its radius.
    """

    centre: Floats
    radius_m: float


def floor_grid(playground: PlaygroundCfg) -> FloorGrid:
    """Return the grid over the bounding rectangle of all rooms."""
    lower = np.array([room.lower_m[:2] for room in playground.rooms])
    upper = lower + [room.size_m[:2] for room in playground.rooms]
    corner = lower.min(axis=0)
    nx, ny = np.ceil((upper.max(axis=0) - corner) / CELL_M).astype(int).tolist()
    return FloorGrid(corner, (nx, ny))


def free_cells(
    grid: FloorGrid, world: World, clear_m: float, passable: Collection[Prop] = ()
) -> Bools:
    """Return which cells have a centre at least `clear_m` from all tangible props.

    Args:
        grid: The cells.
        world: The world.
        clear_m: Least distance from the surfaces of props, see `clearances_m`.
        passable: Props that do not count.

    Returns:
        ``(nx, ny)``.
    """
    free = np.ones(grid.shape, bool)
    for prop in world.props.values():
        if prop.cfg.tangible and prop not in passable:
            free &= clearances_m(prop, grid.centres) >= clear_m
    return free


def outside(grid: FloorGrid, discs: Sequence[Detour]) -> Bools:
    """Return which cells have a centre outside of all discs, ``(nx, ny)``."""
    free = np.ones(grid.shape, bool)
    for centre, radius_m in discs:
        away: NDArray[np.float64] = np.linalg.norm(grid.centres - centre[:2], axis=-1)
        free &= away >= radius_m
    return free


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
        x, y = self._grid.cells_of(np.asarray(place)).tolist()
        return int(x * self._grid.shape[1] + y)

    def _is_straight(self, start: Floats, end: Floats) -> bool:
        """Return whether the cells between two points are free; those of the start do not count."""
        count = max(1, math.ceil(math.dist(start, end) / (0.5 * CELL_M)))
        shares = np.arange(2, count)[:, np.newaxis] / count
        cells = self._grid.cells_of(start + shares * (end - start))
        return bool(self._free[cells[:, 0], cells[:, 1]].all())


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
