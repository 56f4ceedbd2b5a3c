"""Walls and floor coverings of a house from its rooms and doors, with checks of the openings.

A wall stands on every side of a room, outside of it. Rooms that are one wall thickness apart share
the wall between them. Walls in one line form one wall, which the doors in it divide into pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from veca_marl.sim.physics.houses.door_leaves import WallWithDoors, leaf_props
from veca_marl.sim.physics.props import PropCfg, PropShape, check_appearance
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

_TOLERANCE_M = 1e-6


class WallPlane(NamedTuple):
    """Where a straight wall is built.

    Attributes:
        axis: 0 for a wall in a plane of constant x, 1 for one of constant y.
        at_m: That coordinate, of the middle of the wall.
        thickness_m: Its thickness.
    """

    axis: int
    at_m: float
    thickness_m: float


def check_openings(doors: Sequence[DoorCfg], wall: WallPlane, rooms: Sequence[RoomCfg]) -> None:
    """Check the doors in one wall.

    Raises:
        ValueError: If two openings overlap or touch, one reaches beyond a room that it joins, or
            does not lead through the wall from one of its rooms to the other.
    """
    _check_apart(doors, wall.axis)
    for door in doors:
        joined = [room for room in rooms if room.name in door.rooms]
        for room in joined:
            _check_beside(door, wall.axis, room)
        _check_through(door, wall, joined)


def _check_apart(doors: Sequence[DoorCfg], axis: int) -> None:
    """Check that a piece of wall remains between the doors of one wall.

    Raises:
        ValueError: If two openings overlap or touch.
    """
    ordered = sorted(doors, key=lambda door: door.position_m[1 - axis])
    for first, second in pairwise(ordered):
        gap_m = second.position_m[1 - axis] - first.position_m[1 - axis]
        if gap_m - (first.width_m + second.width_m) / 2.0 < _TOLERANCE_M:
            raise ValueError(
                f"doors {first.name!r} and {second.name!r} in one wall overlap or touch: their "
                f"middles are {gap_m:.2f} m apart, with width_m={first.width_m:g} and "
                f"{second.width_m:g}"
            )


def _check_beside(door: DoorCfg, axis: int, room: RoomCfg) -> None:
    """Check that the whole opening of a door is beside one of its rooms.

    Raises:
        ValueError: If it reaches beyond the room, where another wall would stand in it.
    """
    along, half = door.position_m[1 - axis], door.width_m / 2.0
    low, high = _sides(room, 1 - axis)
    if not (low - _TOLERANCE_M <= along - half and along + half <= high + _TOLERANCE_M):
        raise ValueError(
            f"door {door.name!r}: its opening from {along - half:.2f} to {along + half:.2f} m "
            f"reaches beyond room {room.name!r}, from {low:.2f} to {high:.2f} m; move it, or "
            f"choose a smaller width_m than {door.width_m:g}"
        )


def _check_through(door: DoorCfg, wall: WallPlane, rooms: Sequence[RoomCfg]) -> None:
    """Check that nothing but one wall is between the two rooms of a door.

    Raises:
        ValueError: If the rooms are farther apart, so that each has a wall of its own, of which the
            opening is in one only; or if another wall than the one between them holds the door.
    """
    one, other = sorted(rooms, key=lambda room: room.lower_m[wall.axis])
    below, above = _sides(one, wall.axis)[1], _sides(other, wall.axis)[0]
    half = wall.thickness_m / 2.0
    if max(abs(below - wall.at_m + half), abs(above - wall.at_m - half)) > 2.0 * _TOLERANCE_M:
        raise ValueError(
            f"door {door.name!r}: its opening does not lead from room {one.name!r} to "
            f"{other.name!r}, which are {above - below:.4g} m apart along {'xy'[wall.axis]}; rooms "
            f"with a door have to be walls.thickness_m={wall.thickness_m:g} apart, with the door "
            "in the wall between them"
        )


def _sides(room: RoomCfg, axis: int) -> tuple[float, float]:
    """Return the least and the greatest coordinate of a room along an axis, metres."""
    low = room.lower_m[axis]
    return low, low + room.size_m[axis]


COVERING_M = 0.004
"""Height of the coloured covering of a floor, thinner than what casts contact shadows differently
(0.01 m), thick enough that depths of single precision tell it from the floor below."""

_COLOURS = [
    [0.60, 0.70, 0.85],
    [0.85, 0.85, 0.80],
    [0.85, 0.70, 0.70],
    [0.80, 0.85, 0.70],
    [0.75, 0.70, 0.80],
    [0.80, 0.75, 0.65],
    [0.70, 0.80, 0.78],
    [0.85, 0.75, 0.72],
]


@dataclass
class WallsCfg:
    """The walls that are built round the rooms of a playground.

    Attributes:
        thickness_m: Thickness; rooms with a door between them have to be so far apart, others at
            least.
        door_height_m: Height of the openings of doors.
        colours: Colours of the walls in turn, red, green and blue in [0, 1]; empty for eight pale
            ones.
    """

    thickness_m: float = 0.1
    door_height_m: float = 2.0
    colours: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("thickness_m", "door_height_m"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"walls: {name}={value} must be positive and finite")
        for colour in self.colours:
            check_appearance("walls: ", colour, 0.0)


class WallLine(NamedTuple):
    """A straight wall without its doors.

    Attributes:
        axis: 0 for a wall in a plane of constant x, 1 for one of constant y.
        at_m: That coordinate, of the middle of the wall.
        begin_m: Its least coordinate along the other axis.
        end_m: Its greatest coordinate along the other axis.
        height_m: Height.
    """

    axis: int
    at_m: float
    begin_m: float
    end_m: float
    height_m: float


def wall_props(rooms: Sequence[RoomCfg], doors: Sequence[DoorCfg], cfg: WallsCfg) -> list[PropCfg]:
    """Return the walls round rooms, with openings for doors, and the leaves of doors.

    Raises:
        ValueError: If a room is not on the floor, two doors overlap, a wall would stand in a room,
            because two rooms are less than one wall thickness apart, a door is not in a wall,
            reaches beyond one of its rooms or does not lead through to the other, a wall is too
            thin for the leaf of its door or too short for one that slides into it, or meets another
            wall there.
    """
    _check_floors(rooms)
    lines = wall_lines(rooms, cfg.thickness_m)
    walls: list[WallWithDoors] = []
    placed: set[str] = set()
    for number, line in enumerate(lines):
        colours = cfg.colours or _COLOURS
        red, green, blue = colours[number % len(colours)]
        colour = (red, green, blue)
        _check_outside(line, rooms, cfg.thickness_m)
        cut = [door for door in doors if _is_in(door, line)]
        check_openings(cut, WallPlane(line.axis, line.at_m, cfg.thickness_m), rooms)
        placed.update(door.name for door in cut)
        pieces = _pieces(f"wall_{number}", line, cut, cfg, colour)
        walls.append(WallWithDoors(line.axis, cut, pieces))
    missing = sorted({door.name for door in doors} - placed)
    if missing:
        raise ValueError(
            f"doors {missing} are not in the middle of a wall between rooms, which have to be "
            f"walls.thickness_m={cfg.thickness_m:g} apart"
        )
    props: list[PropCfg] = []
    for line, wall in zip(lines, walls, strict=True):
        height_m = min(cfg.door_height_m, line.height_m)
        props += [*wall.pieces, *leaf_props(wall, walls, height_m)]
    return props


def _check_floors(rooms: Sequence[RoomCfg]) -> None:
    """Check that all rooms are on the floor of the world, on which the walls stand."""
    for room in rooms:
        if room.lower_m[2] != 0.0:
            raise ValueError(
                f"room {room.name!r}: lower_m={tuple(room.lower_m)} must have the height 0: walls "
                "are built on the floor of the world"
            )


def floor_coverings(rooms: Sequence[RoomCfg]) -> list[PropCfg]:
    """Return the coloured floors of those rooms that have a colour; they are seen, not felt."""
    props = []
    for room in rooms:
        if room.floor_colour is None:
            continue
        x, y, z = room.middle_m
        props.append(
            PropCfg(
                name=f"floor_{room.name}",
                shape=PropShape.box,
                size_m=[room.size_m[0], room.size_m[1], COVERING_M],
                position_m=(float(x), float(y), float(z) + COVERING_M / 2.0),
                colour=room.floor_colour,
                tangible=False,
            )
        )
    return props


def wall_lines(rooms: Sequence[RoomCfg], thickness_m: float) -> list[WallLine]:
    """Return the walls round rooms as straight lines, those in one line joined."""
    sides: list[WallLine] = []
    for room in rooms:
        for axis in (0, 1):
            begin = room.lower_m[1 - axis] - thickness_m / 2.0
            end = begin + room.size_m[1 - axis] + thickness_m
            low = room.lower_m[axis] - thickness_m / 2.0
            for at in (low, low + room.size_m[axis] + thickness_m):
                sides.append(WallLine(axis, at, begin, end, room.lower_m[2] + room.size_m[2]))
    sides.sort(key=lambda side: (side.axis, round(side.at_m, 6), side.begin_m))
    lines: list[WallLine] = []
    for side in sides:
        last = lines[-1] if lines else None
        if last is not None and _continues(last, side):
            lines[-1] = last._replace(
                end_m=max(last.end_m, side.end_m), height_m=max(last.height_m, side.height_m)
            )
        else:
            lines.append(side)
    return lines


def _continues(line: WallLine, side: WallLine) -> bool:
    aligned = side.axis == line.axis and abs(side.at_m - line.at_m) < _TOLERANCE_M
    return aligned and side.begin_m <= line.end_m + _TOLERANCE_M


def _is_in(door: DoorCfg, line: WallLine) -> bool:
    along = door.position_m[1 - line.axis]
    half = door.width_m / 2.0
    return (
        abs(door.position_m[line.axis] - line.at_m) < _TOLERANCE_M
        and line.begin_m < along - half
        and along + half < line.end_m
    )


def _pieces(
    name: str,
    line: WallLine,
    doors: Sequence[DoorCfg],
    cfg: WallsCfg,
    colour: tuple[float, float, float],
) -> list[PropCfg]:
    """Return the wall beside its doors, and above them if it is higher."""
    props, begin = [], line.begin_m
    for number, door in enumerate(sorted(doors, key=lambda each: each.position_m[1 - line.axis])):
        along, half = door.position_m[1 - line.axis], door.width_m / 2.0
        props.append(_wall(f"{name}_{number}", line, begin, along - half, 0.0, cfg, colour))
        if line.height_m > cfg.door_height_m:
            over = f"wall_over_{door.name}"
            props.append(
                _wall(over, line, along - half, along + half, cfg.door_height_m, cfg, colour)
            )
        begin = along + half
    last = f"{name}_{len(doors)}" if doors else name
    props.append(_wall(last, line, begin, line.end_m, 0.0, cfg, colour))
    return props


def _wall(
    name: str,
    line: WallLine,
    begin: float,
    end: float,
    foot: float,
    cfg: WallsCfg,
    colour: tuple[float, float, float],
) -> PropCfg:
    middle, length, height = (begin + end) / 2.0, end - begin, line.height_m - foot
    across = line.axis == 0  # a wall of constant x extends along y
    return PropCfg(
        name=name,
        shape=PropShape.wall,
        size_m=[cfg.thickness_m, length, height] if across else [length, cfg.thickness_m, height],
        position_m=(line.at_m, middle, foot) if across else (middle, line.at_m, foot),
        colour=colour,
    )


def _check_outside(line: WallLine, rooms: Sequence[RoomCfg], thickness_m: float) -> None:
    """Check that a wall does not stand in a room."""
    axis, half = line.axis, thickness_m / 2.0 - _TOLERANCE_M
    for room in rooms:
        low, high = room.lower_m[axis], room.lower_m[axis] + room.size_m[axis]
        begin = room.lower_m[1 - axis]
        end = begin + room.size_m[1 - axis]
        is_across = line.at_m + half > low and line.at_m - half < high
        if is_across and line.begin_m < end - thickness_m and line.end_m > begin + thickness_m:
            raise ValueError(
                f"room {room.name!r}: a wall of {thickness_m} m round another room stands in it; "
                "adjacent rooms have to be one wall thickness apart"
            )
