"""Doors of a generated house, the floor in front of them, and their hinged leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from veca_marl.sim.physics.houses.floor_division import FloorNeeds, FreeFloor, Rectangle
from veca_marl.sim.physics.rooms import DoorCfg, LeafCfg, RoomCfg

_TOLERANCE_M = 1e-6
POST_M = 0.25
"""Least distance of an opening from the corners of its rooms."""


class Border(NamedTuple):
    """The wall that two rooms share.

    Attributes:
        rooms: Numbers of the rooms, that with the smaller coordinate first.
        axis: 0 if the wall is in a plane of constant x, else 1.
        at_m: That coordinate, of the middle of the wall.
        begin_m: Where the shared part begins along the other axis.
        end_m: Where it ends.
    """

    rooms: tuple[int, int]
    axis: int
    at_m: float
    begin_m: float
    end_m: float


def borders(rooms: Sequence[RoomCfg], wall_m: float) -> list[Border]:
    """Return the walls between all pairs of adjacent rooms."""
    found = []
    for pair in combinations(range(len(rooms)), 2):
        for one, other in (pair, pair[::-1]):
            found += _borders_above(rooms, one, other, wall_m)
    return found


def _borders_above(rooms: Sequence[RoomCfg], one: int, other: int, wall_m: float) -> list[Border]:
    """Return the wall at the upper edge of a room along x or y, if another room is behind it."""
    low, size = rooms[one].lower_m, rooms[one].size_m
    other_low, other_size = rooms[other].lower_m, rooms[other].size_m
    found = []
    for axis in (0, 1):
        edge, along = low[axis] + size[axis], 1 - axis
        begin = max(low[along], other_low[along])
        end = min(low[along] + size[along], other_low[along] + other_size[along])
        if abs(edge + wall_m - other_low[axis]) < _TOLERANCE_M and begin < end:
            found.append(Border((one, other), axis, round(edge + wall_m / 2.0, 6), begin, end))
    return found


def choose_doors(
    rooms: Sequence[RoomCfg],
    wall_m: float,
    width_m: float,
    loops: float,
    rng: np.random.Generator,
) -> list[DoorCfg]:
    """Draw doors so that the rooms are connected, by a random spanning tree (Kruskal 1956).

    Args:
        rooms: Rooms, adjacent ones one wall thickness apart.
        wall_m: Thickness of the walls.
        width_m: Width of the doors.
        loops: Probability of a door in each shared wall that the tree does not need.
        rng: Source of the choice and of the places of the doors.

    Raises:
        ValueError: If the rooms cannot be connected by doors of that width.
    """
    wide = [one for one in borders(rooms, wall_m) if one.end_m - one.begin_m >= opening_m(width_m)]
    group = list(range(len(rooms)))
    chosen = []
    for number in rng.permutation(len(wide)):
        border = wide[number]
        one, other = (group[room] for room in border.rooms)
        if one != other:
            group = [one if each == other else each for each in group]
        elif rng.random() >= loops:
            continue
        chosen.append(border)
    if len(set(group)) > 1:
        raise ValueError(f"doors of {width_m} m cannot connect all rooms")
    return [_door(rooms, border, width_m, rng) for border in chosen]


def opening_m(width_m: float) -> float:
    """Return the least length of a shared wall that a door takes."""
    return width_m + 2.0 * POST_M


def _door(
    rooms: Sequence[RoomCfg], border: Border, width_m: float, rng: np.random.Generator
) -> DoorCfg:
    beside_m = POST_M + width_m / 2.0
    least, greatest = border.begin_m + beside_m, border.end_m - beside_m
    along = min(max(round(float(rng.uniform(least, greatest)), 2), least), greatest)
    one, other = (rooms[room].name for room in border.rooms)
    place = (border.at_m, along) if border.axis == 0 else (along, border.at_m)
    return DoorCfg(f"door_{one}_{other}", (one, other), place, width_m)


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


def hang_leaves(
    rooms: Sequence[RoomCfg],
    doors: Sequence[DoorCfg],
    share: float,
    needs: FloorNeeds,
    rng: np.random.Generator,
) -> list[DoorCfg]:
    """Give doors a hinged leaf that turns to a random side, or to the other one if it fits there.

    A leaf fits if it does not turn into the first room, meets neither what another leaf sweeps nor
    the floor in front of another door, and if the room that it turns into keeps the floor that it
    needs while its leaves are open.

    Args:
        rooms: The rooms of a house; single-room tasks take place in the first one.
        doors: Its doors.
        share: Probability that a leaf is tried at a door.
        needs: The floor that stays free.
        rng: Source of the choices.

    Returns:
        The doors in their order.
    """
    hung = list(doors)
    for number, door in enumerate(doors):
        if rng.random() >= share:
            continue
        to_front = bool(rng.random() < 0.5)
        for opens_to_front in (to_front, not to_front):
            hung[number] = replace(door, leaf=LeafCfg(opens_to_front=opens_to_front))
            if _fits(hung[number], rooms, hung, needs):
                break
            hung[number] = door
    return hung


def _fits(
    door: DoorCfg, rooms: Sequence[RoomCfg], doors: Sequence[DoorCfg], needs: FloorNeeds
) -> bool:
    """Return whether the leaf of a door can turn, and the floor is open while it is open."""
    own = (room for room in rooms if room.name in door.rooms)
    room = next(room for room in own if turns_into(floor_of(room), door))
    if room is rooms[0]:
        return False
    floor = floor_of(room)
    here = [each for each in doors if room.name in each.rooms]
    swept = in_front(floor, door, door.width_m)
    others = [kept_free(floor, each) for each in here if each is not door]
    if not _contains(floor, swept) or any(overlap(swept, other) for other in others):
        return False
    leaves = [open_leaf(floor, each) for each in here if turns_into(floor, each)]
    return needs.are_met(FreeFloor(floor, leaves), [front(floor, each) for each in here])


def _contains(outer: Rectangle, inner: Rectangle) -> bool:
    return all(
        outer.lower_m[axis] <= inner.lower_m[axis]
        and inner.lower_m[axis] + inner.size_m[axis] <= outer.lower_m[axis] + outer.size_m[axis]
        for axis in (0, 1)
    )
