"""The walls of a maze in a room, as props that are placed anew for each maze."""

from __future__ import annotations

import colorsys
import math

import numpy as np

from veca_marl.envs.tasks.navigation.mazes.maze import Cell, Edge, Maze
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World

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
