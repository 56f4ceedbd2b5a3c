"""Mazes: cells on a square grid with exactly one path between any two of them."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from veca_marl.sim.geometry import Bools

Cell: TypeAlias = tuple[int, int]  # column along x, row along y


class Edge(NamedTuple):
    """The border between two neighbouring cells.

    Attributes:
        cell: The cell with the smaller column or row.
        axis: 0 if the other cell is the next one along x, 1 along y.
    """

    cell: Cell
    axis: int


class Maze(NamedTuple):
    """A square of cells.

    Attributes:
        is_open: ``(2, n, n)``: whether the border between a cell and the next one along x, or
            along y, is open. The entries of the last column, or row, are False.
    """

    is_open: Bools

    @property
    def size(self) -> int:
        """Cells along each side."""
        return int(self.is_open.shape[1])

    def closed_edges(self) -> list[Edge]:
        """Return the inner borders with a wall: ``(n - 1)^2`` in a maze of ``n x n`` cells."""
        return [edge for edge in _inner_edges(self.size) if not self.is_open[edge.axis][edge.cell]]

    def neighbours(self, cell: Cell) -> list[Cell]:
        """Return the cells that can be entered from a cell."""
        found = []
        for other, edge in _adjacent(cell, self.size):
            if self.is_open[edge.axis][edge.cell]:
                found.append(other)
        return found

    def steps_from(self, start: Cell) -> dict[Cell, int]:
        """Return the number of steps from a cell to every cell."""
        steps, frontier = {start: 0}, [start]
        for cell in frontier:
            for other in self.neighbours(cell):
                if other not in steps:
                    steps[other] = steps[cell] + 1
                    frontier.append(other)
        return steps


def random_maze(size: int, rng: np.random.Generator) -> Maze:
    """Draw a maze by a randomised depth-first search, which gives long corridors.

    Args:
        size: Cells along each side, at least 2.
        rng: Random generator.
    """
    is_open = np.zeros((2, size, size), bool)
    x, y = rng.integers(size, size=2).tolist()
    visited, path = {(x, y)}, [(x, y)]
    while path:
        choices = [pair for pair in _adjacent(path[-1], size) if pair[0] not in visited]
        if not choices:
            path.pop()
            continue
        cell, edge = choices[int(rng.integers(len(choices)))]
        is_open[edge.axis][edge.cell] = True
        visited.add(cell)
        path.append(cell)
    return Maze(is_open)


def _adjacent(cell: Cell, size: int) -> list[tuple[Cell, Edge]]:
    """Return the neighbouring cells inside the square, with the border to each."""
    x, y = cell
    pairs = [
        ((x + 1, y), Edge((x, y), 0)),
        ((x - 1, y), Edge((x - 1, y), 0)),
        ((x, y + 1), Edge((x, y), 1)),
        ((x, y - 1), Edge((x, y - 1), 1)),
    ]
    return [(other, edge) for other, edge in pairs if min(other) >= 0 and max(other) < size]


def _inner_edges(size: int) -> list[Edge]:
    along_x = [Edge((x, y), 0) for x in range(size - 1) for y in range(size)]
    along_y = [Edge((x, y), 1) for x in range(size) for y in range(size - 1)]
    return along_x + along_y
