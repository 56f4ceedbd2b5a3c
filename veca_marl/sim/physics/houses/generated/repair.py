"""What is taken away from a generated house so that leaves turn and no position is closed off.

No random numbers are drawn: the rest of a house does not depend on what is taken away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics.houses.door_leaves import leaf_name
from veca_marl.sim.physics.houses.footprints import Footprint, footprints
from veca_marl.sim.physics.houses.furniture import furniture_prop
from veca_marl.sim.physics.houses.generated.house_data import HouseData
from veca_marl.sim.physics.houses.house_repair import (
    NODE_M,
    WITH_LEAVES,
    WalkerFloor,
    WalkerLaw,
    distance_m,
)
from veca_marl.sim.physics.houses.leaf_swing import first_met, open_footprints
from veca_marl.sim.physics.houses.walls import WallsCfg, wall_props
from veca_marl.sim.physics.props import PropCfg, PropShape
from veca_marl.sim.physics.rooms import RoomCfg

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
