"""Playgrounds as data: rooms with their acoustics, walls, and the props that stand in them.

The paper's four playgrounds (section "Playgrounds") differ in furniture and structure and set the
difficulty of the same task. Each is a file in `conf/playground/`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from veca_marl.sim.physics.prop_cfg import PropCfg
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg
from veca_marl.sim.sound import House, Room
from veca_marl.sim.sound.house import TRANSMISSION_LOSS_DB

THICKEST_WALL_M = 0.5
"""The threshold of a door lies within the wall: at most so far from either room."""


@dataclass
class PlaygroundCfg:
    """A place to play in.

    Attributes:
        name: As on the command line.
        rooms: Boxes of air; the first is where single-room tasks play. Walls and large boxes
            between them attenuate sound, see `stops_sound`.
        doors: The openings between rooms.
        props: Walls, furniture and toys.
        floor_size_m: Extent of the drawn floor along x and y.
        floor_centre_m: Its middle.
        floor_colour: Red, green, blue in [0, 1].
        floor_checker_m: Edge of the floor's checker pattern.
        image_order: Greatest number of reflections of a sound; 0 is the direct sound alone.
        transmission_loss_db: Attenuation of a sound from another room by each obstacle.
    """

    name: str = ""
    rooms: list[RoomCfg] = field(default_factory=lambda: [RoomCfg()])
    doors: list[DoorCfg] = field(default_factory=list)
    props: list[PropCfg] = field(default_factory=list)
    floor_size_m: tuple[float, float] = (6.0, 6.0)
    floor_centre_m: tuple[float, float] = (0.0, 0.0)
    floor_colour: tuple[float, float, float] = (0.75, 0.65, 0.5)
    floor_checker_m: float = 0.5
    image_order: int = 1
    transmission_loss_db: float = TRANSMISSION_LOSS_DB

    @property
    def floor_m2(self) -> float:
        """Area of the floors of all rooms."""
        return sum(room.size_m[0] * room.size_m[1] for room in self.rooms)

    def __post_init__(self) -> None:
        """Check that there is a room, that names are unique, and the numbers."""
        if not self.rooms:
            raise ValueError(f"playground {self.name!r} has no room")
        self._check_names("props", [prop.name for prop in self.props])
        self._check_names("doors", [door.name for door in self.doors])
        self._check_doors()
        if self.image_order < 0:
            raise ValueError(
                f"playground {self.name!r}: image_order={self.image_order} is negative"
            )
        loss_db = self.transmission_loss_db
        if not (math.isfinite(loss_db) and loss_db >= 0.0):
            raise ValueError(
                f"playground {self.name!r}: transmission_loss_db={loss_db} must be finite, "
                "0 or more"
            )

    def _check_names(self, kind: str, names: list[str]) -> None:
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"playground {self.name!r}: {kind} share the names {twice}")

    def _check_doors(self) -> None:
        """Check that every door lies between two rooms that exist."""
        rooms = {room.name: room for room in self.rooms}
        if self.doors and len(rooms) < len(self.rooms):
            names = [room.name for room in self.rooms]
            raise ValueError(f"playground {self.name!r}: doors need rooms of unique names: {names}")
        for door in self.doors:
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


def make_house(playground: PlaygroundCfg) -> House:
    """Return the acoustic rooms of a playground, without obstacles."""
    rooms = [Room(room.lower_m, room.size_m, room.reflection) for room in playground.rooms]
    return House(rooms, playground.image_order, playground.transmission_loss_db)
