"""Furnished houses that are generated from a seed."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, field

import numpy as np

from veca_marl.sim.physics.houses.floor_division import FloorNeeds, Limits, Rectangle, divide
from veca_marl.sim.physics.houses.generated_doors import choose_doors, hang_leaves, opening_m
from veca_marl.sim.physics.houses.generated_furniture import RoomFurnishing, furnish, uses_of
from veca_marl.sim.physics.houses.house_repair import HouseData, repaired
from veca_marl.sim.physics.houses.walls import WallsCfg
from veca_marl.sim.physics.playground import PLAYGROUND_GENERATORS, PlaygroundCfg
from veca_marl.sim.physics.rooms import RoomCfg

GENERATOR = "random_house"

_PASSAGE_M = (0.3, 0.75)
"""Least width and height of a door, with room to spare for a body with a radius of 0.11 m and a
height of 0.72 m."""
_LARGE = 2.0  # weight of the area of one room; that of the others is 1
_COVERING = (0.45, 0.75)  # saturation and brightness of the coverings of floors


@dataclass
class RandomHouseCfg(PlaygroundCfg):
    """A furnished house that is generated from a seed: the same numbers give the same house.

    A rectangle is divided recursively into rooms; a random spanning tree of adjacent rooms, and
    some more pairs, have doors; furniture stands along the walls. A body with a radius of 0.11 m
    reaches all doors, and every position that is 0.15 m or more away from walls and furniture,
    0.2 m in houses with leaves; a piece of furniture that would prevent this, or that a leaf would
    meet, is taken away. The first room is the widest and has furniture at its walls of constant x
    only, and no leaf turns into it, as single-room tasks need it; its middle is the origin.

    Attributes:
        rooms: Generated; cannot be set.
        doors: Likewise.
        furniture: Likewise.
        generator: Name of this class among the generators of playgrounds.
        seed: Seed of the house, 0 or more. It does not depend on the seed of a run.
        room_count: Number of rooms.
        house_size_m: Extent of the floors with the walls between them along x and y.
        least_room_m: Least side of a room.
        room_height_m: Height of the rooms.
        door_width_m: Width of the doors.
        loops: Probability of a door between two adjacent rooms that are connected already.
        leaves: Probability that a door has a hinged leaf, which is open at the start. Doors where
            one would meet another leaf, or close off a part of the floor, have none.
        pieces_per_room: Least and greatest number of pieces of furniture that are placed in a
            room; those for which there is no space, or that close a position off, are left
            out. A room has each kind of its use at most once: 4 in a bathroom, 6 in the living
            room, 5 in the others.
    """

    rooms: list[RoomCfg] = field(default_factory=list)
    walls: WallsCfg | None = field(default_factory=WallsCfg)
    generator: str = GENERATOR
    seed: int = 0
    room_count: int = 5
    house_size_m: tuple[float, float] = (11.0, 9.0)
    least_room_m: float = 3.2
    room_height_m: float = 2.6
    door_width_m: float = 1.0
    loops: float = 0.4
    leaves: float = 0.0
    pieces_per_room: tuple[int, int] = (3, 5)

    def __post_init__(self) -> None:
        """Check the numbers and generate the house."""
        for name in ("rooms", "doors", "furniture"):
            if getattr(self, name):
                raise ValueError(
                    f"playground.{name} of a random house cannot be set: it is generated from "
                    "playground.seed; choose another playground, such as house, to set it"
                )
        self._check_numbers()
        self.rooms, self.doors, self.furniture = generate_house(self)
        self._set_floor()
        super().__post_init__()

    def _check_numbers(self) -> None:
        if self.generator != GENERATOR:
            raise ValueError(f"playground.generator={self.generator!r} must be {GENERATOR!r}")
        if self.walls is None:
            raise ValueError("playground.walls of a random house must not be null")
        if self.seed < 0:
            raise ValueError(f"playground.seed={self.seed} must be 0 or more")
        for name in ("loops", "leaves"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"playground.{name}={getattr(self, name)} must be in [0, 1]")
        least, greatest = self.pieces_per_room
        if not 0 <= least <= greatest:
            raise ValueError(
                f"playground.pieces_per_room={tuple(self.pieces_per_room)} must be (least, "
                "greatest), 0 or more"
            )
        self._check_rooms_fit()

    def _check_rooms_fit(self) -> None:
        """Check that the house holds its rooms, and its walls the doors."""
        sizes = (*self.house_size_m, self.room_height_m, self.door_width_m)
        if not all(0.0 < size < float("inf") for size in sizes):
            raise ValueError(
                f"playground.house_size_m={tuple(self.house_size_m)}, "
                f"room_height_m={self.room_height_m} and door_width_m={self.door_width_m} must be "
                "positive and finite"
            )
        self._check_passages()
        needed_m = max(opening_m(self.door_width_m), _open_floor_m())
        if not self.least_room_m >= needed_m:
            raise ValueError(
                f"playground.least_room_m={self.least_room_m} must be at least {needed_m:.2f}, for "
                f"doors of {self.door_width_m} m and an open floor"
            )
        most = self.most_rooms
        if most < 1:
            raise ValueError(
                f"playground.house_size_m={tuple(self.house_size_m)} is too small for one room of "
                f"least_room_m={self.least_room_m}"
            )
        if not 1 <= self.room_count <= most:
            raise ValueError(
                f"playground.room_count={self.room_count} must be from 1 to {most}: so many rooms "
                f"of {self.least_room_m} m fit into house_size_m={tuple(self.house_size_m)}"
            )

    def _check_passages(self) -> None:
        """Check that a body fits through the doors."""
        width_m, height_m = _PASSAGE_M
        if self.door_width_m < width_m:
            raise ValueError(
                f"playground.door_width_m={self.door_width_m} must be at least {width_m}, for a "
                "body to pass"
            )
        heights = {"room_height_m": self.room_height_m}
        if self.walls is not None:
            heights["walls.door_height_m"] = self.walls.door_height_m
        for name, value in heights.items():
            if value < height_m:
                raise ValueError(
                    f"playground.{name}={value} must be at least {height_m}, for a body to pass"
                )

    @property
    def most_rooms(self) -> int:
        """The greatest `room_count` that fits into `house_size_m`."""
        return limits_of(self).capacity(self.house_size_m)

    def _set_floor(self) -> None:
        """Let the floor reach to the inner faces of the outer walls."""
        corners = np.array([room.lower_m[:2] for room in self.rooms])
        ends = corners + [room.size_m[:2] for room in self.rooms]
        low, high = corners.min(axis=0), ends.max(axis=0)
        x, y = (float(value) for value in (low + high) / 2.0)
        self.floor_centre_m = round(x, 6), round(y, 6)
        width, depth = (round(float(value), 6) for value in high - low)
        self.floor_size_m = width, depth


def limits_of(cfg: RandomHouseCfg) -> Limits:
    """Return the limits of the division into rooms."""
    return Limits(cfg.least_room_m, walls_of(cfg).thickness_m)


def walls_of(cfg: RandomHouseCfg) -> WallsCfg:
    """Return the walls, which are never null in a checked configuration."""
    return WallsCfg() if cfg.walls is None else cfg.walls


def generate_house(cfg: RandomHouseCfg) -> HouseData:
    """Return the house of a seed and the other numbers of a configuration."""
    rng = np.random.default_rng(cfg.seed)
    limits = limits_of(cfg)
    weights = rng.permutation([_LARGE, *[1.0] * (cfg.room_count - 1)]).tolist()
    whole = Rectangle((0.0, 0.0), (cfg.house_size_m[0], cfg.house_size_m[1]))
    # the living room is the widest: single-room tasks take place there
    parts = sorted(divide(whole, weights, limits, rng), key=lambda part: -min(part.size_m))
    uses = uses_of(cfg.room_count, rng)
    rooms = _rooms(parts, uses, cfg.room_height_m, rng)
    doors = choose_doors(rooms, limits.wall_m, cfg.door_width_m, cfg.loops, rng)
    needs = FloorNeeds()
    # a generator of its own: the same seed has the same rooms and doors with and without leaves
    doors = hang_leaves(rooms, doors, cfg.leaves, needs, *rng.spawn(1))
    furniture = []
    for number, (room, use) in enumerate(zip(rooms, uses, strict=True)):
        furnishing = RoomFurnishing(room, doors, needs, sides_free=number == 0)
        least, greatest = cfg.pieces_per_room
        count = int(rng.integers(least, greatest + 1))
        furniture += furnish(room, use, furnishing, count, rng)
    return repaired(HouseData(rooms, doors, furniture), walls_of(cfg))


def _rooms(
    parts: list[Rectangle], uses: list[str], height_m: float, rng: np.random.Generator
) -> list[RoomCfg]:
    """Return rooms with names, echoes and coloured floors, the middle of the first at the origin.

    The hues of the floors are evenly spaced, from a random one on.
    """
    first = parts[0]
    middle = [round(low + size / 2.0, 2) for low, size in zip(*first, strict=True)]
    hue = float(rng.random())
    rooms = []
    for number, (part, use) in enumerate(zip(parts, uses, strict=True)):
        again = uses[:number].count(use)
        x, y = (round(low - centre, 6) for low, centre in zip(part.lower_m, middle, strict=True))
        rooms.append(
            RoomCfg(
                name=use if again == 0 else f"{use}_{again + 1}",
                lower_m=(x, y, 0.0),
                size_m=(*part.size_m, height_m),
                reflection=round(float(rng.uniform(0.4, 0.6)), 2),
                floor_colour=_covering((hue + number / len(parts)) % 1.0),
            )
        )
    return rooms


def _covering(hue: float) -> tuple[float, float, float]:
    red, green, blue = (round(channel, 3) for channel in colorsys.hsv_to_rgb(hue, *_COVERING))
    return red, green, blue


def _open_floor_m() -> float:
    """Return the least side of a room that has the open floor of `FloorNeeds` while it is empty."""
    needs = FloorNeeds()
    return 2.0 * needs.clear_m + needs.extent_m


PLAYGROUND_GENERATORS.add(GENERATOR, RandomHouseCfg)
