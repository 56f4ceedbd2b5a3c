"""Hinged leaves for some doors of a generated house."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from veca_marl.sim.physics.houses.floor_division import Rectangle
from veca_marl.sim.physics.houses.generated.door_fronts import (
    floor_of,
    front,
    in_front,
    kept_free,
    open_leaf,
    overlap,
    turns_into,
)
from veca_marl.sim.physics.houses.generated.free_floor import FloorNeeds, FreeFloor
from veca_marl.sim.physics.rooms import DoorCfg, LeafCfg, RoomCfg


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
