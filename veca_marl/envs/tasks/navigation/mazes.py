"""Mazes: cells on a square grid with exactly one path between any two of them, and their walls."""

from __future__ import annotations

import colorsys
import math
from typing import NamedTuple, TypeAlias

import numpy as np

from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World

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


SMALLEST_CELL_M = 0.7
"""Least edge of a cell, the passage for a walker of radius 0.11 m that turns, and half a wall on
either side. An object in the middle of a cell cannot be reached from beyond its walls."""
_THICKNESS_M, _HEIGHT_M = 0.1, 1.0
_SATURATION, _VALUE = 0.45, 0.85


class MazeWalls:
    """The inner walls of mazes of one size, which fill a square room.

    All mazes of ``n x n`` cells with one path between any two cells have ``(n - 1)^2`` inner walls.
    The walls differ in hue, so that places look different.

    Args:
        world: A world that is not frozen, with a single, square room without furniture.
        cells: Cells along each side, at least 2.

    Raises:
        ValueError: If the room does not fit, or the cells are too small for it.
    """

    def __init__(self, world: World, cells: int) -> None:
        check_maze(world.playground, cells)
        self._room = world.playground.rooms[0]
        self._cell_m = self._room.size_m[0] / cells
        count = (cells - 1) ** 2
        # walls in line meet without overlap: faces in one plane would flicker in the images
        self._walls = [
            _add_wall(world, f"maze_wall_{number}", self._cell_m, number / count)
            for number in range(count)
        ]

    def build(self, maze: Maze, rng: np.random.Generator) -> None:
        """Place the walls of a maze; which of them stands where is drawn."""
        order = rng.permutation(len(self._walls)).tolist()
        for number, edge in zip(order, maze.closed_edges(), strict=True):
            middle, yaw_rad = self._border(edge)
            self._walls[number].place(middle, yaw_rad)

    def middle_of(self, cell: Cell, height_m: float = 0.0) -> Floats:
        """Return the middle of a cell at a height above the floor, ``(3,)`` metres."""
        x, y, z = self._room.lower_m
        along = self._cell_m * (np.array(cell) + 0.5)
        return np.array([x + along[0], y + along[1], z + height_m])

    def _border(self, edge: Edge) -> tuple[Floats, float]:
        """Return the middle of a border and the yaw of a wall along it."""
        middle = self.middle_of(edge.cell)
        middle[edge.axis] += self._cell_m / 2.0
        return middle, math.pi / 2.0 if edge.axis == 0 else 0.0


def _add_wall(world: World, name: str, length_m: float, hue: float) -> Prop:
    red, green, blue = colorsys.hsv_to_rgb(hue, _SATURATION, _VALUE)
    return world.add_prop(
        PropCfg(
            name=name,
            shape=PropShape.wall,
            size_m=[length_m, _THICKNESS_M, _HEIGHT_M],
            colour=(red, green, blue),
        )
    )


def passage_m(playground: PlaygroundCfg, cells: int) -> float:
    """Return the width between two opposite walls of a cell, metres, see `beyond_walls_m`."""
    return playground.rooms[0].size_m[0] / cells - _THICKNESS_M


def beyond_walls_m(playground: PlaygroundCfg, cells: int, body_m: float) -> float:
    """Return the least distance from the middle of a cell to a body beyond one of its walls.

    The wall stands on the border of the cell, half of it on either side. A body at the end of a
    wall, past a corner of the cell, is farther away.

    Args:
        playground: A playground that `check_maze` accepts.
        cells: Cells along each side.
        body_m: Radius of the body.

    Returns:
        Horizontal distance to the middle of the body, metres.
    """
    cell_m = playground.rooms[0].size_m[0] / cells
    return cell_m / 2.0 + _THICKNESS_M / 2.0 + body_m


def check_maze(playground: PlaygroundCfg, cells: int) -> None:
    """Check that a maze can be built in a playground.

    Raises:
        ValueError: If the playground is not a single square room without furniture, there are fewer
            than 2 cells along a side, or the cells are too small.
    """
    room = playground.rooms[0]
    length_x, length_y, _ = room.size_m
    props = [prop for prop in playground.built_props() if prop.tangible]
    furniture = [prop.name for prop in props if prop.shape is not PropShape.wall]
    if len(playground.rooms) > 1 or furniture or length_x != length_y:
        raise ValueError(
            f"playground {playground.name!r} has {len(playground.rooms)} rooms, the first of "
            f"{length_x} x {length_y} m, and {len(furniture)} pieces of furniture; a maze fills a "
            "single square room without furniture: choose playground=simple"
        )
    most = int(length_x / SMALLEST_CELL_M)
    if not 2 <= cells <= most:
        raise ValueError(
            f"task.cells={cells} must be from 2 to {most} in room {room.name!r} of {length_x} m: "
            f"a cell measures {SMALLEST_CELL_M} m or more"
        )
