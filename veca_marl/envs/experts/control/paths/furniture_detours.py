"""Ways from a place to a waypoint: straight, or round the furniture that is between."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from veca_marl.envs.tasks.floors.grid_paths import PathsTo
from veca_marl.envs.tasks.navigation.floors.floor_grid import CELL_M, floor_grid, free_cells
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import Prop, World

_GREATEST_CLEARANCE_M = 0.3  # half of a door 1 m wide, less the cells that a path needs
_OPEN = 0.5  # a leaf that is further open leaves room to walk through


class Detours(Protocol):
    """Ways to waypoints of a path."""

    def next_point(self, place: Floats, waypoint: Floats) -> Floats:
        """Return the next point ``(2,)`` of the way from a place to a waypoint, metres."""
        ...


class StraightWays:
    """No detours: for floors without furniture in the way."""

    def next_point(self, place: Floats, waypoint: Floats) -> Floats:
        """See `Detours`."""
        return waypoint


class FurnitureDetours:
    """Shortest ways that keep a distance from walls and furniture.

    Toys and closed doors are walked into, and move. An open door is walked round: a body that comes
    from behind its leaf would close it, and a leaf that opens towards the body stays closed.

    Args:
        world: The world; its props are where they are now.
        clear_m: Least distance, limited so that doors are passable.
    """

    def __init__(self, world: World, clear_m: float) -> None:
        self._grid = floor_grid(world.playground)
        moved = [prop for prop in world.props.values() if _is_pushed_away(prop)]
        limited_m = min(clear_m, _GREATEST_CLEARANCE_M)
        self._free = free_cells(self._grid, world, limited_m, passable=moved)
        self._paths: tuple[Floats, PathsTo] | None = None

    def next_point(self, place: Floats, waypoint: Floats) -> Floats:
        """See `Detours`."""
        known = self._paths
        if known is None or horizontal_distance(waypoint, known[0]) > CELL_M:
            known = np.array(waypoint), PathsTo(self._grid, self._free, waypoint)
            self._paths = known
        return known[1].next_point(place)


def _is_pushed_away(prop: Prop) -> bool:
    if prop.joint is None:
        return not prop.fixed
    return prop.opening < _OPEN


def detours_in(world: World, clear_m: float) -> Detours:
    """Return ways round furniture in a furnished playground, else straight ones."""
    return FurnitureDetours(world, clear_m) if world.playground.furniture else StraightWays()
