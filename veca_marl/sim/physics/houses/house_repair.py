"""What is taken away from a generated house so that leaves turn and no position is closed off.

`FreeFloor` rejects most pieces of furniture that would close a position off while they are placed,
room by room, with bounding rectangles that are rounded up to its cells: gaps look narrower than
they are, so that it overlooks positions in some of them. Here the whole house is measured with the
exact shapes that are built.

No random numbers are drawn: the rest of a house does not depend on what is taken away.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from veca_marl.sim.geometry import Bools, Floats
from veca_marl.sim.physics.houses.door_leaves import first_met, leaf_name, open_footprints
from veca_marl.sim.physics.houses.footprints import Footprint, footprints
from veca_marl.sim.physics.houses.furniture import FurnitureCfg, furniture_prop
from veca_marl.sim.physics.houses.walls import WallsCfg, wall_props
from veca_marl.sim.physics.props import PropCfg, PropShape
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

NODE_M = 0.02
"""Distance of the points at which distances are computed."""

_TIE_M = 1e-6  # distances are often equal to a limit: all lengths are whole centimetres
_COARSE = 2  # of the points, every second along x and y


@dataclass(frozen=True)
class WalkerLaw:
    """What a walker reaches.

    Attributes:
        radius_m: Its radius.
        height_m: What begins above this height is not in its way.
        space_m: Positions that are so far away from walls and things are all connected.
        closed_off_m2: Greatest area of the positions that have less space and are closed off, on
            the coarse grid of `WalkerFloor`.
    """

    radius_m: float = 0.11
    height_m: float = 0.75
    space_m: float = 0.15
    closed_off_m2: float = 0.008

    def closed_off(self, clearance_m: Floats, most: float) -> Bools:
        """Return where a walker fits but does not arrive, if this breaks the law.

        Args:
            clearance_m: ``(nx, ny)`` distance of points of a square grid from the nearest thing.
            most: Greatest number of such points if none of them has space round it.

        Returns:
            ``(nx, ny)``; all are False where the law holds.
        """
        beyond = _beyond_largest(clearance_m >= self.radius_m - _TIE_M)
        has_space = bool((clearance_m[beyond] >= self.space_m - _TIE_M).any())
        return beyond if has_space or beyond.sum() > most else np.zeros_like(beyond)


def _beyond_largest(free: Bools) -> Bools:
    """Return which free cells are not in the largest connected area."""
    labels, count = ndimage.label(free)
    if count < 2:
        return np.zeros_like(free)
    beyond: Bools = free & (labels != 1 + int(np.argmax(np.bincount(labels.ravel())[1:])))
    return beyond


WITH_LEAVES = WalkerLaw(space_m=0.2, closed_off_m2=0.048)
"""The law where leaves stand open, which leave small areas behind them."""


class WalkerFloor:
    """Distances of a grid of points, over all rooms, from walls and things.

    Args:
        rooms: The rooms of a house with walls.
        things: What is in the way, with sides along x and y.
        reach_m: Greatest distance that matters.

    Attributes:
        clearance_m: ``(nx, ny)`` distance of each point, at most `reach_m`; 0 inside of things.
    """

    def __init__(
        self, rooms: Sequence[RoomCfg], things: Sequence[Footprint], reach_m: float
    ) -> None:
        low = np.min([room.lower_m[:2] for room in rooms], axis=0)
        high = np.max([np.add(room.lower_m, room.size_m)[:2] for room in rooms], axis=0)
        self._axes: list[Floats] = [
            np.arange(begin, end + NODE_M, NODE_M) for begin, end in zip(low, high, strict=True)
        ]
        self._low: Floats = low
        self.clearance_m: Floats = np.full([len(axis) for axis in self._axes], reach_m)
        for thing in things:
            near = self._near(thing, reach_m)
            self.clearance_m[near] = np.minimum(self.clearance_m[near], self._away_m(thing, near))

    def closed_off(self, law: WalkerLaw) -> Floats:
        """Return the points ``(n, 2)`` that break a law, metres; none where it holds.

        Positions with space are looked for on all points, and again on every second one: the
        middles of cells from the corner of the house on, where passages have to be somewhat
        wider. Areas are measured on these cells.
        """
        coarse_m = _COARSE * NODE_M
        most = round(law.closed_off_m2 / coarse_m**2)
        return np.concatenate(
            [
                self._closed_off(law, slice(None), math.inf),
                self._closed_off(law, slice(_COARSE - 1, None, _COARSE), most),
            ]
        )

    def _closed_off(self, law: WalkerLaw, taken: slice, most: float) -> Floats:
        """Return those of some points that break a law, see `WalkerLaw.closed_off`."""
        cells = np.nonzero(law.closed_off(self.clearance_m[taken, taken], most))
        x, y = (axis[taken][numbers] for axis, numbers in zip(self._axes, cells, strict=True))
        return np.stack([x, y], axis=-1)

    def _near(self, thing: Footprint, reach_m: float) -> tuple[slice, slice]:
        """Return the points that can be nearer to a thing than a distance."""
        spread = np.array(_half_m(thing)) + thing.radius_m + reach_m
        first = np.floor((np.array(thing.centre_m) - spread - self._low) / NODE_M).astype(int)
        end = np.ceil((np.array(thing.centre_m) + spread - self._low) / NODE_M).astype(int) + 1
        x, y = (
            slice(max(begin, 0), max(stop, 0))
            for begin, stop in zip(first.tolist(), end.tolist(), strict=True)
        )
        return x, y

    def _away_m(self, thing: Footprint, near: tuple[slice, slice]) -> Floats:
        x, y = (axis[part] for axis, part in zip(self._axes, near, strict=True))
        return distance_m(thing, x[:, None], y[None, :])


def distance_m(thing: Footprint, x: Floats, y: Floats) -> Floats:
    """Return the distance of points to a thing with sides along x and y, or a round one, metres."""
    half_x, half_y = _half_m(thing)
    out_x = np.maximum(np.abs(x - thing.centre_m[0]) - half_x, 0.0)
    out_y = np.maximum(np.abs(y - thing.centre_m[1]) - half_y, 0.0)
    away: Floats = np.maximum(np.hypot(out_x, out_y) - thing.radius_m, 0.0)
    return away


def _half_m(thing: Footprint) -> tuple[float, float]:
    """Return half of the extents along x and y of what a thing consists of round its middle.

    A round thing is all within its radius of its middle.
    """
    if thing.radius_m:
        return 0.0, 0.0
    cos, sin = abs(math.cos(thing.yaw_rad)), abs(math.sin(thing.yaw_rad))
    width, depth = thing.half_m
    return cos * width + sin * depth, sin * width + cos * depth


class HouseData(NamedTuple):
    """A generated house.

    Attributes:
        rooms: The rooms, the living room first.
        doors: The doors between them.
        furniture: What stands in them, in the order in which it was placed.
    """

    rooms: list[RoomCfg]
    doors: list[DoorCfg]
    furniture: list[FurnitureCfg]


_BESIDE_M = 4.0 * NODE_M  # beyond the radius of a walker, from a position to what closes it off


class _Built(NamedTuple):
    """A house as it is built, by the names of props.

    Attributes:
        walls: The pieces of the walls.
        leaves: The leaves of doors.
        furniture: The pieces of furniture, in the order in which they were placed.
    """

    walls: Mapping[str, PropCfg]
    leaves: Mapping[str, PropCfg]
    furniture: Mapping[str, PropCfg]

    def without(self, name: str) -> _Built:
        """Return it without a leaf or a piece of furniture."""
        leaves, furniture = (
            {key: prop for key, prop in props.items() if key != name}
            for props in (self.leaves, self.furniture)
        )
        return _Built(self.walls, leaves, furniture)

    def things(self) -> dict[str, list[Footprint]]:
        """Return what is in the way of a walker, walls without a name of their own."""
        return {
            "": [area for wall in self.walls.values() for area in footprints(wall)],
            **{name: open_footprints(leaf) for name, leaf in self.leaves.items()},
            **{name: footprints(piece) for name, piece in self.furniture.items()},
        }

    @property
    def law(self) -> WalkerLaw:
        """What a walker reaches."""
        return WITH_LEAVES if self.leaves else WalkerLaw()


def repaired(house: HouseData, walls: WallsCfg) -> HouseData:
    """Return a house without what a leaf meets and without what closes off a position.

    Args:
        house: A generated house.
        walls: The walls that are built round its rooms.

    Raises:
        ValueError: If walls close off a position.
    """
    built = _with_everything_reached(house.rooms, _with_leaves_that_turn(_built(house, walls)))
    doors = [
        door if leaf_name(door) in built.leaves else replace(door, leaf=None)
        for door in house.doors
    ]
    kept = [piece for piece in house.furniture if piece.name in built.furniture]
    return HouseData(house.rooms, doors, kept)


def _built(house: HouseData, walls: WallsCfg) -> _Built:
    props = wall_props(house.rooms, house.doors, walls)
    return _Built(
        {prop.name: prop for prop in props if prop.shape is PropShape.wall},
        {prop.name: prop for prop in props if prop.shape is not PropShape.wall},
        {piece.name: furniture_prop(piece) for piece in house.furniture},
    )


def _with_leaves_that_turn(built: _Built) -> _Built:
    """Take away furniture that a leaf meets, and leaves that meet a wall."""
    for name, leaf in built.leaves.items():
        while name in built.leaves:
            met = first_met(leaf, [*built.walls.values(), *built.furniture.values()])
            if met is None:
                break
            built = built.without(met.thing.name if met.thing.name in built.furniture else name)
    return built


def _with_everything_reached(rooms: Sequence[RoomCfg], built: _Built) -> _Built:
    """Take away what closes off a position, until every one is reached.

    Of the furniture and leaves beside what is closed off, that goes first which opens the most of
    it; of several, the piece that was placed last.
    """
    closed_off = _closed_off(rooms, built)
    while len(closed_off):
        choices = [built.without(name) for name in reversed(_beside(closed_off, built))]
        if not choices:
            x, y = closed_off[0].tolist()
            raise ValueError(
                f"the walls of this random house close off the position ({x:.2f}, {y:.2f}) m; "
                "choose a greater playground.door_width_m"
            )
        left = [_closed_off(rooms, choice) for choice in choices]
        least = min(range(len(choices)), key=lambda number: len(left[number]))
        built, closed_off = choices[least], left[least]
    return built


def _closed_off(rooms: Sequence[RoomCfg], built: _Built) -> Floats:
    """Return the points ``(n, 2)`` of the floor that break the law, metres."""
    law = built.law
    in_the_way = [
        area for areas in built.things().values() for area in areas if area.low_m < law.height_m
    ]
    return WalkerFloor(rooms, in_the_way, law.space_m).closed_off(law)


def _beside(points: Floats, built: _Built) -> list[str]:
    """Return the names of the leaves and pieces of furniture that are beside some points."""
    reach_m = built.law.radius_m + _BESIDE_M
    x, y = points.T
    return [
        name
        for name, areas in built.things().items()
        if name and any((distance_m(area, x, y) < reach_m).any() for area in areas)
    ]
