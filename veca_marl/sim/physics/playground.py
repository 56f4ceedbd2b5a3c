"""Playgrounds as data: rooms with their acoustics, walls, and the props that stand in them.

The paper's four playgrounds (section "Playgrounds") differ in furniture and structure and set the
difficulty of the same task. Each is a file in `conf/playground/`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import combinations

from veca_marl.registry import Registry
from veca_marl.sim.physics.houses.door_leaves import check_swings, leaf_name
from veca_marl.sim.physics.houses.furniture import FurnitureCfg, check_furniture, furniture_prop
from veca_marl.sim.physics.houses.walls import WallsCfg, floor_coverings, wall_props
from veca_marl.sim.physics.impact_sounds import ImpactCfg
from veca_marl.sim.physics.props import PropCfg, PropShape, check_appearance
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg
from veca_marl.sim.sound import House, Room
from veca_marl.sim.sound.partitions import MOST_LOSS_DB, TRANSMISSION_LOSS_DB
from veca_marl.sim.sound.screens import Doorway

THICKEST_WALL_M = 0.5
"""The threshold of a door lies within the wall, at most so far from either room."""

_CENTRED = {PropShape.box, PropShape.sphere, PropShape.cylinder, PropShape.capsule}

SHARED_VOLUME_M3 = 1e-6
"""Greatest volume that two adjacent rooms may share, for rounding errors of their corners."""

GREATEST_IMAGE_ORDER = 12
"""Greatest `PlaygroundCfg.image_order`, which makes 2625 image sources of each source. Their number
grows with the third power of the order, and so do the memory and time of every step."""


@dataclass
class PlaygroundCfg:
    """Rooms, walls and furniture in which a game is played.

    Attributes:
        name: As on the command line.
        rooms: Boxes of air with unique names that do not overlap; the first is where single-room
            tasks play. Walls and large boxes between them attenuate sound, see `sound_obstacles`.
        doors: The openings between rooms.
        walls: How walls are built round the rooms, with openings for the doors; None if the walls
            are among the props.
        furniture: Pieces of furniture; their sizes are fixed. Each stands in a room, apart from
            others, from doors and from leaves that turn.
        props: Everything else: toys, walls where `walls` is None, things of any size.
        floor_size_m: Extent of the drawn floor along x and y.
        floor_centre_m: Its middle.
        floor_colour: Red, green, blue in [0, 1].
        floor_checker_m: Edge of the floor's checker pattern.
        image_order: Greatest number of reflections of a sound, from 0 (the direct sound only) to
            `GREATEST_IMAGE_ORDER`.
        transmission_loss_db: Loss of a sound at 500 Hz that passes through an obstacle, 0 to 200.
        impacts: Sounds of things that hit each other or the floor.
    """

    name: str = ""
    rooms: list[RoomCfg] = field(default_factory=lambda: [RoomCfg()])
    doors: list[DoorCfg] = field(default_factory=list)
    walls: WallsCfg | None = None
    furniture: list[FurnitureCfg] = field(default_factory=list)
    props: list[PropCfg] = field(default_factory=list)
    floor_size_m: tuple[float, float] = (6.0, 6.0)
    floor_centre_m: tuple[float, float] = (0.0, 0.0)
    floor_colour: tuple[float, float, float] = (0.75, 0.65, 0.5)
    floor_checker_m: float = 0.5
    image_order: int = 1
    transmission_loss_db: float = TRANSMISSION_LOSS_DB
    impacts: ImpactCfg = field(default_factory=ImpactCfg)

    @property
    def floor_m2(self) -> float:
        """Area of the floors of all rooms."""
        return sum(room.size_m[0] * room.size_m[1] for room in self.rooms)

    def built_props(self) -> list[PropCfg]:
        """Return all props: coverings of floors, walls, furniture, then `props`."""
        built = floor_coverings(self.rooms)
        if self.walls is not None:
            built += wall_props(self.rooms, self.doors, self.walls)
        return [*built, *map(furniture_prop, self.furniture), *self.props]

    def __post_init__(self) -> None:
        """Check that there is a room, that names are unique, the numbers and the furniture."""
        if not self.rooms:
            raise ValueError(f"playground {self.name!r} has no room")
        self._check_names("doors", [door.name for door in self.doors])
        self._check_rooms()
        self._check_doors()
        self._check_names("props", [prop.name for prop in self.built_props()])
        self._check_things()
        self._check_floor()
        self._check_sound()

    def _check_rooms(self) -> None:
        """Check that no two rooms share a name or a volume."""
        self._check_names("rooms", [room.name for room in self.rooms])
        for one, other in combinations(self.rooms, 2):
            shared_m3 = one.overlap_m3(other)
            if shared_m3 > SHARED_VOLUME_M3:
                raise ValueError(
                    f"playground {self.name!r}: rooms {one.name!r} and {other.name!r} overlap by "
                    f"{shared_m3:.3g} m3; a point belongs to at most one room"
                )

    def _check_things(self) -> None:
        """Check the places of furniture, that leaves can turn, and that free props are not sunk."""
        start = f"playground {self.name!r}: "
        try:
            check_furniture(self.furniture, self.rooms, self.doors, walled=self.walls is not None)
            self._check_leaves()
        except ValueError as error:
            raise ValueError(f"{start}{error}") from None
        for prop in self.props:
            is_free = prop.mass_kg > 0.0 and prop.joint is None
            if is_free and prop.shape in _CENTRED and prop.position_m[2] < 0.0:
                raise ValueError(
                    f"{start}prop {prop.name!r}: position_m={tuple(prop.position_m)} is below the "
                    "floor, at the height 0, although the prop can move; its position is that of "
                    "its centre"
                )

    def _check_leaves(self) -> None:
        """Check that hinged leaves meet neither walls nor furniture."""
        doors = [door for door in self.doors if door.leaf is not None]
        if not doors:
            return
        built = {prop.name: prop for prop in self.built_props()}
        pieces = {piece.name for piece in self.furniture}
        things = [
            prop for prop in built.values() if prop.shape is PropShape.wall or prop.name in pieces
        ]
        check_swings(doors, [built[leaf_name(door)] for door in doors], things)

    def _check_floor(self) -> None:
        """Check the numbers of the drawn floor."""
        if not all(math.isfinite(size) and size > 0.0 for size in self.floor_size_m):
            raise ValueError(
                f"playground {self.name!r}: floor_size_m={tuple(self.floor_size_m)} "
                "must be two positive lengths"
            )
        if not all(math.isfinite(value) for value in self.floor_centre_m):
            raise ValueError(
                f"playground {self.name!r}: floor_centre_m={tuple(self.floor_centre_m)} "
                "must be finite"
            )
        start = f"playground {self.name!r}: "
        check_appearance(start, self.floor_colour, self.floor_checker_m, "floor_")

    def _check_sound(self) -> None:
        """Check the numbers of the rooms' acoustics."""
        order = self.image_order
        if not (0 <= order <= GREATEST_IMAGE_ORDER and order == int(order)):
            raise ValueError(
                f"playground {self.name!r}: image_order={order} must be a whole number from 0 "
                f"(direct sound) to {GREATEST_IMAGE_ORDER}"
            )
        loss_db = self.transmission_loss_db
        if not 0.0 <= loss_db <= MOST_LOSS_DB:
            raise ValueError(
                f"playground {self.name!r}: transmission_loss_db={loss_db} must be from 0 to "
                f"{MOST_LOSS_DB:g}"
            )

    def _check_names(self, kind: str, names: list[str]) -> None:
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"playground {self.name!r}: {kind} share the names {twice}")

    def _check_doors(self) -> None:
        """Check that every door lies between two rooms that exist."""
        rooms = {room.name: room for room in self.rooms}
        for door in self.doors:
            if door.leaf is not None and self.walls is None:
                raise ValueError(
                    f"playground {self.name!r}, door {door.name!r}: a leaf needs walls, which are "
                    "null; without them a leaf is a prop with a joint"
                )
            unknown = sorted(set(door.rooms) - set(rooms))
            if unknown:
                raise ValueError(
                    f"playground {self.name!r}, door {door.name!r}: no rooms {unknown}; "
                    f"there are {sorted(rooms)}"
                )
            for name in door.rooms:
                away_m = rooms[name].distance_m(door.position_m)
                if away_m > THICKEST_WALL_M:
                    raise ValueError(
                        f"playground {self.name!r}, door {door.name!r}: "
                        f"position_m={tuple(door.position_m)} is {away_m:.2f} m from {name!r}"
                    )


PLAYGROUND_GENERATORS: Registry[type[PlaygroundCfg]] = Registry("generator of playgrounds")
"""Dataclasses that generate the content of a playground from their numbers. A file of
`conf/playground` names one as its schema, and in its field `generator`."""


def make_house(playground: PlaygroundCfg) -> House:
    """Return the acoustic rooms of a playground, without obstacles."""
    rooms = [Room(room.lower_m, room.size_m, room.reflection) for room in playground.rooms]
    doorways = [_doorway(door, playground.rooms) for door in playground.doors]
    return House(rooms, playground.image_order, playground.transmission_loss_db, doorways)


def _doorway(door: DoorCfg, rooms: list[RoomCfg]) -> Doorway:
    """Return the opening of a door, which leads across the gap between its rooms."""
    numbers = {room.name: number for number, room in enumerate(rooms)}
    one, other = (numbers[name] for name in door.rooms)
    axis = int(rooms[one].gap_m(rooms[other], 1) > rooms[one].gap_m(rooms[other], 0))
    return Doorway((one, other), door.position_m, door.width_m, axis)
