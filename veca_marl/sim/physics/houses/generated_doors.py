"""Doors of a generated house: every room can be reached from every other one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from veca_marl.sim.physics.rooms import DoorCfg, RoomCfg

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
