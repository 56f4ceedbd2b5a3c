"""Checks that a task can be played with a playground, before or after a world is built."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.physics import DoorCfg, JointKind, PlaygroundCfg, Prop, RandomHouseCfg, RoomCfg

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


_LEAST_AGENTS = 2
_RANDOM_HOUSE = "random_house"

ROOMS = {
    "two_rooms": 2,
    "three_rooms": 3,
    "four_rooms": 4,
    "house": 4,
    "seven_rooms": 7,
    "house2": 7,
}
"""Number of rooms of the playgrounds that have several."""


def check_rooms(playground: PlaygroundCfg, agents: int) -> None:
    """Check that a playground has a room for each agent.

    Raises:
        ValueError: If it has too few.
    """
    rooms = len(playground.rooms)
    if agents <= rooms:
        return
    raise ValueError(
        f"task.agents={agents} start in rooms of their own, but playground "
        f"{playground.name!r} has {rooms}; choose {' or '.join(_choices(rooms, agents))}"
    )


def _choices(rooms: int, agents: int) -> list[str]:
    """Return what to choose instead of a playground that has too few rooms for the agents."""
    larger = [name for name, count in ROOMS.items() if count >= agents]
    choices = [f"playground={', '.join(larger)}"] if larger else []
    if agents <= RandomHouseCfg(name=_RANDOM_HOUSE).most_rooms:
        choices.append(f"playground={_RANDOM_HOUSE} playground.room_count={agents}")
    if rooms >= _LEAST_AGENTS:
        return [*choices, f"task.agents of at most {rooms}"]
    if choices:
        return choices
    most = max(ROOMS.values())
    largest = ", ".join(name for name, count in ROOMS.items() if count == most)
    return [f"playground={largest} with task.agents of at most {most}"]


def check_doorways(playground: PlaygroundCfg, players: Sequence[Player]) -> None:
    """Check that walking bodies fit through all doors.

    Heights are known where the walls are built from `PlaygroundCfg.walls`. Joint-level bodies can
    crawl and turn: they are not checked.

    Raises:
        ValueError: If a door is narrower or lower than a body.
    """
    for player in players:
        if isinstance(player.body, Walker):
            _check(playground, player.body)


def _check(playground: PlaygroundCfg, body: Walker) -> None:
    for door in playground.doors:
        if door.width_m <= 2.0 * body.cfg.radius_m:
            raise ValueError(
                f"playground {playground.name!r}: door {door.name!r} has width_m={door.width_m:g}: "
                f"{body.name} with body.radius_m={body.cfg.radius_m:g} does not fit through it"
            )
    walls = playground.walls
    if playground.doors and walls is not None and walls.door_height_m <= body.cfg.capsule_height_m:
        raise ValueError(
            f"playground {playground.name!r}: walls.door_height_m={walls.door_height_m:g} is too "
            f"low for {body.name} with body.capsule_height_m={body.cfg.capsule_height_m:g}"
        )


TRIALS = 20
"""Number of placements that are tried.

Where one episode in ten would find no places, 20 trials show it with a probability of 0.88.
"""


def check_placement(
    place: Callable[[np.random.Generator], object], asked: str, choice: str
) -> None:
    """Try out a random placement with fixed generators.

    A task draws places at the start of an episode until they fit, some hundred times at most. A
    trial that finds none stands for episodes that would fail at their start.

    Args:
        place: Draws the places of one episode, and raises `ValueError` if it finds none. It is
            called `TRIALS` times: what does not depend on the generator is better found before.
        asked: The values of the task that matter, for the message.
        choice: What to choose instead, for the message.

    Raises:
        ValueError: If a trial finds no places.
    """
    try:
        for seed in range(TRIALS):
            place(np.random.default_rng(seed))
    except ValueError as error:
        raise ValueError(f"{asked}: {error}; choose {choice}") from None


def check_kickable(players: Iterable[Player], ball: Prop) -> None:
    """Check that the ball of a task is light enough for all players that walk.

    Raises:
        ValueError: If a walker cannot kick it.
    """
    for player in players:
        body = player.body
        if isinstance(body, Walker) and not body.is_light(ball):
            raise ValueError(
                f"task.mass_kg={ball.cfg.mass_kg:g}: {player.name} kicks and pushes at most "
                f"body.push_limit_kg={body.cfg.push_limit_kg:g}"
            )
