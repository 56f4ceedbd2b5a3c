"""Occupancy of the floor: which cells of a grid a body can stand in, beside furniture and walls."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.tasks.navigation.floors.clearance import clearances_m
from veca_marl.sim.geometry import Bools, Floats
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

    def cell_of(self, place: Floats) -> tuple[int, int]:
        """Return the indices of the cell that contains a place, or of the nearest one."""
        index = np.floor((np.asarray(place)[:2] - self.lower_m) / CELL_M).astype(int)
        x, y = np.clip(index, 0, np.array(self.shape) - 1).tolist()
        return x, y


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
