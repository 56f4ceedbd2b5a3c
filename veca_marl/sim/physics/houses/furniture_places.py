"""Checks that furniture stands in a room, beside other furniture and beside doors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from veca_marl.sim.physics.houses.footprints import Footprint, footprints, overlap_m
from veca_marl.sim.physics.houses.furniture import furniture_prop
from veca_marl.sim.physics.houses.furniture_cfg import FurnitureCfg
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

_TOLERANCE_M = 0.01  # of places that are given with two decimals
_KEPT_FREE_M = 0.1  # in front of the opening of a door, on both sides


def check_furniture(
    furniture: Sequence[FurnitureCfg],
    rooms: Sequence[RoomCfg],
    doors: Sequence[DoorCfg],
    *,
    walled: bool,
) -> None:
    """Check the places of furniture.

    Args:
        furniture: The pieces.
        rooms: The rooms of the house.
        doors: Its doors.
        walled: Whether walls are built round each room. Otherwise rooms may touch, and a piece may
            stand in several.

    Raises:
        ValueError: If a piece is not in a room, reaches into another one or stands in a door.
    """
    areas = {piece.name: footprints(furniture_prop(piece)) for piece in furniture}
    for piece in furniture:
        _check_in_room(piece, areas[piece.name], rooms, walled)
        for door in doors:
            _check_beside(piece, areas[piece.name], door, rooms)
    for one, other in combinations(furniture, 2):
        depth_m = _overlap_m(areas[one.name], areas[other.name])
        if depth_m > _TOLERANCE_M:
            raise ValueError(
                f"furniture {one.name!r} at position_m={tuple(one.position_m)} and {other.name!r} "
                f"at {tuple(other.position_m)} overlap by {depth_m:.2f} m; move one of them"
            )


def _check_in_room(
    piece: FurnitureCfg, areas: Sequence[Footprint], rooms: Sequence[RoomCfg], walled: bool
) -> None:
    points = [point for area in areas for point in (area.centre_m, *area.outline())]
    if walled:
        inside = any(all(_is_in(room, point) for point in points) for room in rooms)
    else:
        inside = all(any(_is_in(room, point) for room in rooms) for point in points)
    if inside:
        return
    nearest = min(rooms, key=lambda room: room.distance_m(piece.position_m))
    x, y, _ = nearest.lower_m
    raise ValueError(
        f"furniture {piece.name!r}: a {piece.kind.name} at position_m={tuple(piece.position_m)}, "
        f"yaw_deg={piece.yaw_deg:g} is not inside a room; the nearest one, {nearest.name!r}, "
        f"extends from {x:g} to {x + nearest.size_m[0]:g} m along x and from {y:g} to "
        f"{y + nearest.size_m[1]:g} m along y"
    )


def _check_beside(
    piece: FurnitureCfg, areas: Sequence[Footprint], door: DoorCfg, rooms: Sequence[RoomCfg]
) -> None:
    opening = _opening(door, rooms)
    if opening is not None and _overlap_m(areas, [opening]) > _TOLERANCE_M:
        raise ValueError(
            f"furniture {piece.name!r} at position_m={tuple(piece.position_m)} stands in the "
            f"opening of door {door.name!r} at {tuple(door.position_m)}, width_m={door.width_m:g}; "
            "move one of them"
        )


def _opening(door: DoorCfg, rooms: Sequence[RoomCfg]) -> Footprint | None:
    """Return the opening of a door with the floor that stays free in front of it.

    It is None between rooms of which one is above the other.
    """
    one, other = (next(room for room in rooms if room.name == name) for name in door.rooms)
    gaps_m = [max(_gap_m(one, other, axis), _gap_m(other, one, axis)) for axis in (0, 1)]
    axis = 0 if gaps_m[0] >= gaps_m[1] else 1
    if gaps_m[axis] < -_TOLERANCE_M:
        return None
    half_m = [door.width_m / 2.0, door.width_m / 2.0]
    half_m[axis] = gaps_m[axis] / 2.0 + _KEPT_FREE_M
    high_m = min(one.size_m[2], other.size_m[2])
    return Footprint(
        (door.position_m[0], door.position_m[1]), (half_m[0], half_m[1]), 0.0, 0.0, high_m
    )


def _gap_m(one: RoomCfg, other: RoomCfg, axis: int) -> float:
    """Return the distance along an axis from the end of one room to the beginning of another."""
    return other.lower_m[axis] - one.lower_m[axis] - one.size_m[axis]


def _overlap_m(areas: Sequence[Footprint], others: Sequence[Footprint]) -> float:
    return max(overlap_m(one, other) for one in areas for other in others)


def _is_in(room: RoomCfg, point: tuple[float, float]) -> bool:
    return room.distance_m(point) <= _TOLERANCE_M
