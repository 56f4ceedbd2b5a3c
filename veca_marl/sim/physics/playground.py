"""Playgrounds as data: rooms that sound, walls and props that stand in them.

The paper's four playgrounds (section "Playgrounds") differ in furniture and structure and set the
difficulty of the same task. Each is a file in `conf/playground/`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.props import PropCfg
from veca_marl.sim.sound.house import TRANSMISSION_LOSS_DB

THICKEST_WALL_M = 0.5
"""A door's threshold lies within the wall, so at most so far from either room."""


@dataclass
class RoomCfg:
    """A box of air between walls: an acoustic room and a place to start from.

    Attributes:
        name: Unique in its playground.
        lower_m: The lower corner, metres.
        size_m: Extent along x, y and z, metres.
        reflection: Pressure reflection coefficient beta of its walls in [0, 1)
            (Allen & Berkley 1979); 0 is a room without echo.
    """

    name: str = "room"
    lower_m: tuple[float, float, float] = (-3.0, -3.0, 0.0)
    size_m: tuple[float, float, float] = (6.0, 6.0, 2.6)
    reflection: float = 0.5

    def __post_init__(self) -> None:
        """Refuse rooms without inside, or in which sound could not die."""
        if not all(math.isfinite(corner) for corner in self.lower_m):
            raise ValueError(f"room {self.name!r}: lower_m={tuple(self.lower_m)} must be finite")
        if not all(math.isfinite(size) and size > 0 for size in self.size_m):
            raise ValueError(f"room {self.name!r}: size_m={tuple(self.size_m)} must be positive")
        if not 0.0 <= self.reflection < 1.0:
            raise ValueError(f"room {self.name!r}: reflection={self.reflection} is not in [0, 1)")

    def contains(self, position: Floats, margin_m: float = 0.0) -> bool:
        """Say whether a point is inside, at least `margin_m` from walls, floor and ceiling."""
        low = np.asarray(self.lower_m) + margin_m
        high = np.asarray(self.lower_m) + np.asarray(self.size_m) - margin_m
        return bool(np.all(position >= low) and np.all(position <= high))

    def away_m(self, point: tuple[float, float]) -> float:
        """Return how far a point of the floor plan is from the room, metres; 0 inside."""
        low, size = np.array(self.lower_m[:2]), np.array(self.size_m[:2])
        out = np.maximum(np.maximum(low - point, point - low - size), 0.0)
        return float(np.linalg.norm(out))

    @property
    def middle_m(self) -> Floats:
        """``(3,)`` metres: the middle of the floor."""
        x, y = np.array(self.lower_m[:2]) + np.array(self.size_m[:2]) / 2.0
        return np.array([x, y, self.lower_m[2]])

    def sample_floor(self, rng: np.random.Generator, margin_m: float) -> Floats:
        """Draw a point of the floor, ``(3,)`` metres, at least `margin_m` from the walls.

        Raises:
            ValueError: If the room is too small for that margin.
        """
        low, size = np.asarray(self.lower_m), np.asarray(self.size_m)
        if not size[:2].min() >= 2.0 * margin_m:
            raise ValueError(
                f"room {self.name!r}: size_m={tuple(self.size_m)} leaves no floor {margin_m} m "
                "away from the walls"
            )
        point = rng.uniform(low[:2] + margin_m, low[:2] + size[:2] - margin_m)
        return np.array([point[0], point[1], low[2]])

    def sample_start(self, rng: np.random.Generator, margin_m: float) -> tuple[Floats, float]:
        """Draw a place to run from: near the edge of the floor, the room's middle ahead.

        Returns:
            The point ``(3,)`` metres, on a circle that comes as near as `margin_m` to the walls,
            and the heading (rad) to the middle.

        Raises:
            ValueError: If the room is too small for that margin.
        """
        low, size = np.asarray(self.lower_m), np.asarray(self.size_m)
        radius = size[:2].min() / 2.0 - margin_m
        if radius < 0.0:
            raise ValueError(
                f"room {self.name!r}: size_m={tuple(self.size_m)} leaves no floor {margin_m} m "
                "away from the walls"
            )
        heading = rng.uniform(-math.pi, math.pi)
        back = np.array([math.cos(heading), math.sin(heading)]) * radius
        x, y = low[:2] + size[:2] / 2.0 - back
        return np.array([x, y, low[2]]), heading


@dataclass
class DoorCfg:
    """An opening in the wall between two rooms: known as data, so that nobody has to guess.

    The walls round it are props. An opening is there or not; a door that opens is a prop in one.

    Attributes:
        name: Unique in its playground.
        rooms: The names of the two rooms it joins.
        position_m: The middle of its threshold, x and y, metres.
        width_m: How wide it is.
    """

    name: str = "door"
    rooms: tuple[str, str] = ("", "")
    position_m: tuple[float, float] = (0.0, 0.0)
    width_m: float = 1.0

    def __post_init__(self) -> None:
        """A door is somewhere, and leads somewhere else."""
        if not all(math.isfinite(value) for value in self.position_m):
            raise ValueError(f"door {self.name!r}: position_m={tuple(self.position_m)}")
        if not (math.isfinite(self.width_m) and self.width_m > 0.0):
            raise ValueError(f"door {self.name!r}: width_m={self.width_m} must be positive")
        if self.rooms[0] == self.rooms[1]:
            raise ValueError(f"door {self.name!r}: rooms={tuple(self.rooms)} must be two")


@dataclass
class PlaygroundCfg:
    """A place to play in.

    Attributes:
        name: As on the command line.
        rooms: Boxes of air; the first is where single-room tasks play. Walls and large boxes
            between them attenuate sound, see `props.stops_sound`.
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
        """Names are looked up, so they must be unique, and there must be a room to play in."""
        if not self.rooms:
            raise ValueError(f"playground {self.name!r} has no room")
        for kind, things in (("props", self.props), ("doors", self.doors)):
            names = [thing.name for thing in things]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"playground {self.name!r}: {kind} share the names {twice}")
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

    def _check_doors(self) -> None:
        """Refuse doors to nowhere."""
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
                away_m = rooms[name].away_m(door.position_m)
                if away_m > THICKEST_WALL_M:
                    raise ValueError(
                        f"playground {self.name!r}, door {door.name!r}: "
                        f"position_m={tuple(door.position_m)} is {away_m:.2f} m from {name!r}"
                    )
