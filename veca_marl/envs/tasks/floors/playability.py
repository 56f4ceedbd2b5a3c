"""A check that bodies get from each room to every other one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

from veca_marl.sim.body.walker import WalkerCfg
from veca_marl.sim.physics import DoorCfg, JointKind, PlaygroundCfg, RoomCfg

_TOUCHING_M = 0.01  # greatest distance of rooms without a wall between them


def check_connected(task: str, playground: PlaygroundCfg, rooms: Sequence[RoomCfg]) -> None:
    """Check that doors lead from each of some rooms to all others, also through further rooms.

    Closed leaves that are not locked count as passable, since bodies push them open, and so do
    locked ones with a key. Rooms that touch need no door where no walls are built.

    Args:
        task: Name of the task, for the message.
        playground: The house.
        rooms: The rooms in which players or things can be.

    Raises:
        ValueError: If a room cannot be reached; the message names it and the choices.
    """
    if not rooms:
        return
    reached = _reached_from(rooms[0].name, playground)
    beyond = [room.name for room in rooms if room.name not in reached]
    if not beyond:
        return
    locked = sorted(door.name for door in playground.doors if _is_shut(door))
    unlock = f", set leaf.locked=false for {locked}" if locked else ""
    raise ValueError(
        f"{task}: no doors of playground {playground.name!r} lead from room {rooms[0].name!r} to "
        f"{beyond}; add doors to playground.doors{unlock}, or choose another playground, such as "
        "playground=house"
    )


def _reached_from(start: str, playground: PlaygroundCfg) -> set[str]:
    """Return the names of the rooms that can be reached from one, with its own."""
    pairs = [tuple(door.rooms) for door in playground.doors if not _is_shut(door)]
    if playground.walls is None:
        both = combinations(playground.rooms, 2)
        pairs += [(one.name, other.name) for one, other in both if _touch(one, other)]
    reached, size = {start}, 0
    while len(reached) > size:
        size = len(reached)
        for pair in pairs:
            if reached & set(pair):
                reached |= set(pair)
    return reached


def _is_shut(door: DoorCfg) -> bool:
    """Return whether a leaf that no key unlocks leaves too narrow an opening for a body."""
    leaf = door.leaf
    if leaf is None or not leaf.locked or leaf.key:
        return False
    share = leaf.opening
    if leaf.kind is JointKind.hinge:
        share = 1.0 - math.cos(math.pi / 2.0 * leaf.opening)
    return share * door.width_m < 2.0 * WalkerCfg().radius_m


def _touch(one: RoomCfg, other: RoomCfg) -> bool:
    """Return whether two rooms have a part of a side in common."""
    gaps_m = sorted(
        max(one.lower_m[axis], other.lower_m[axis])
        - min(one.lower_m[axis] + one.size_m[axis], other.lower_m[axis] + other.size_m[axis])
        for axis in (0, 1)
    )
    return gaps_m[0] < 0.0 and gaps_m[1] <= _TOUCHING_M
