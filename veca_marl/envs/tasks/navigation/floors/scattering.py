"""Places on the floors of all rooms, apart from each other, from furniture and from doors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.envs.tasks.navigation.floors.clearance import Clearances
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import DoorCfg, PlaygroundCfg, RoomCfg, StandingProp

_DRAWS = 300  # of one place, until all places are drawn again
_RESTARTS = 20


class Spacing(NamedTuple):
    """Least distances of drawn places.

    Attributes:
        clear_m: From walls and from surfaces of furniture.
        apart_m: From each other.
        door_m: From the middles of doors.
    """

    clear_m: float
    apart_m: float
    door_m: float


def scattered_places(
    playground: PlaygroundCfg,
    furniture: Sequence[StandingProp],
    count: int,
    spacing: Spacing,
    rng: np.random.Generator,
) -> list[Floats]:
    """Draw places uniformly on the floors of all rooms, subject to a spacing.

    Args:
        playground: The rooms and doors.
        furniture: Props to keep away from.
        count: Number of places.
        spacing: Least distances.
        rng: Random generator of the episode.

    Returns:
        `count` places, ``(3,)`` metres each.

    Raises:
        ValueError: If none of 20 attempts succeeds; the message names the playground.
    """
    rooms = wide_rooms(playground.rooms, spacing.clear_m)
    clearances = Clearances(furniture)
    for _ in range(_RESTARTS if rooms else 0):
        found: list[Floats] = []
        for _ in range(_DRAWS):
            place = _random_place(rooms, spacing.clear_m, rng)
            if _keeps(place, found, clearances, playground.doors, spacing):
                found.append(place)
            if len(found) == count:
                return found
    widest = max(playground.rooms, key=lambda room: min(room.size_m[:2]))
    raise ValueError(
        f"playground {playground.name!r} leaves no {count} places {spacing.apart_m:.2f} m apart "
        f"and {spacing.clear_m:.2f} m away from furniture and walls (its widest room is "
        f"{widest.extent})"
    )


def wide_rooms(rooms: Sequence[RoomCfg], clear_m: float) -> list[RoomCfg]:
    """Return the rooms with floor at a distance from their walls, in which places are drawn."""
    return [room for room in rooms if min(room.size_m[:2]) > 2.0 * clear_m]


def _random_place(rooms: Sequence[RoomCfg], clear_m: float, rng: np.random.Generator) -> Floats:
    """Draw a place uniformly on the floors of rooms, at a distance from their walls."""
    areas = [math.prod(size - 2.0 * clear_m for size in room.size_m[:2]) for room in rooms]
    room = rooms[int(rng.choice(len(rooms), p=np.array(areas) / sum(areas)))]
    return room.sample_floor(rng, clear_m)


def _keeps(
    place: Floats,
    others: Sequence[Floats],
    furniture: Clearances,
    doors: Sequence[DoorCfg],
    spacing: Spacing,
) -> bool:
    return (
        all(horizontal_distance(place, other) >= spacing.apart_m for other in others)
        and all(math.dist(place[:2], door.position_m) >= spacing.door_m for door in doors)
        and furniture.all_at_least(place[:2], spacing.clear_m)
    )
