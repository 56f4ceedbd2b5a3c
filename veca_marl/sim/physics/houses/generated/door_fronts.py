"""The floor of a generated room in front of its doors, and where their hinged leaves turn."""

from __future__ import annotations

from veca_marl.sim.physics.houses.floor_division import Rectangle
from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

DOOR_DEPTH_M = 0.7
"""Depth of the floor in front of a door that stays free."""

_FRONT_M = 0.4  # distance from the wall of the point in front of a door that must be reachable
_LEAF_M = 0.1  # a hinged leaf with its handles and the gap at its hinge


def floor_of(room: RoomCfg) -> Rectangle:
    """Return the floor of a room."""
    return Rectangle((room.lower_m[0], room.lower_m[1]), (room.size_m[0], room.size_m[1]))


def in_front(floor: Rectangle, door: DoorCfg, depth_m: float = DOOR_DEPTH_M) -> Rectangle:
    """Return the floor of a room in front of one of its doors, as wide as the door."""
    axis, upper = _wall_of(floor, door)
    lower, size = [0.0, 0.0], [door.width_m, door.width_m]
    size[axis] = depth_m
    edge = floor.lower_m[axis] + floor.size_m[axis] - depth_m
    lower[axis] = edge if upper else floor.lower_m[axis]
    lower[1 - axis] = door.position_m[1 - axis] - door.width_m / 2.0
    return Rectangle((lower[0], lower[1]), (size[0], size[1]))


def kept_free(floor: Rectangle, door: DoorCfg) -> Rectangle:
    """Return the floor in front of a door that furniture leaves free, also for a hinged leaf."""
    if not turns_into(floor, door):
        return in_front(floor, door)
    return in_front(floor, door, max(DOOR_DEPTH_M, door.width_m))


def front(floor: Rectangle, door: DoorCfg) -> tuple[float, float]:
    """Return the point in front of a door from which it is passed straight."""
    axis, upper = _wall_of(floor, door)
    place = [door.position_m[0], door.position_m[1]]
    edge = floor.lower_m[axis] + floor.size_m[axis]
    place[axis] = edge - _FRONT_M if upper else floor.lower_m[axis] + _FRONT_M
    return place[0], place[1]


def turns_into(floor: Rectangle, door: DoorCfg) -> bool:
    """Return whether a door of a room has a hinged leaf that turns into that room."""
    _, upper = _wall_of(floor, door)
    return door.leaf is not None and door.leaf.opens_to_front != upper


def open_leaf(floor: Rectangle, door: DoorCfg) -> Rectangle:
    """Return the floor that the open leaf of a door covers in the room that it turns into.

    Its hinge is at the end of lower y in a wall of constant x, and at that of greater x in a wall
    of constant y, see `door_leaf`.
    """
    axis, _ = _wall_of(floor, door)
    swept = in_front(floor, door, door.width_m)
    lower, size = list(swept.lower_m), list(swept.size_m)
    if axis == 1:
        lower[0] += size[0] - _LEAF_M
    size[1 - axis] = _LEAF_M
    return Rectangle((lower[0], lower[1]), (size[0], size[1]))


def overlap(one: Rectangle, other: Rectangle) -> bool:
    """Return whether two rectangles share an area."""
    return all(
        one.lower_m[axis] < other.lower_m[axis] + other.size_m[axis]
        and other.lower_m[axis] < one.lower_m[axis] + one.size_m[axis]
        for axis in (0, 1)
    )


def _wall_of(floor: Rectangle, door: DoorCfg) -> tuple[int, bool]:
    """Return the axis of the wall of a room that a door is in, and whether it is the upper one."""
    gaps = {
        (axis, upper): abs(
            floor.lower_m[axis] + (floor.size_m[axis] if upper else 0.0) - door.position_m[axis]
        )
        for axis in (0, 1)
        for upper in (False, True)
        if floor.lower_m[1 - axis]
        < door.position_m[1 - axis]
        < floor.lower_m[1 - axis] + floor.size_m[1 - axis]
    }
    return min(gaps, key=lambda wall: gaps[wall])
