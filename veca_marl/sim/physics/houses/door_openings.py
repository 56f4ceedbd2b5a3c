"""Checks that the openings of doors in a built wall lead from room to room."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

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
