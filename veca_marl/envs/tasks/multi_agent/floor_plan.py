"""Rooms and the doors between them as a graph: how to get from one to another."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics import DoorCfg, PlaygroundCfg, RoomCfg

_CORNER_M = 0.7  # so far from both walls somebody has room in a corner


class DoorApproach(NamedTuple):
    """How somebody goes through doors.

    Attributes:
        before_m: From so far before it the opening is straight ahead; so far beyond it all is
            passed.
        right_m: How far to the right of the middle, if the door is wide enough: others come the
            other way.
    """

    before_m: float
    right_m: float


class _Passage(NamedTuple):
    """A door as one of its two rooms has it."""

    door: DoorCfg
    out: Floats  # (2,) unit vector, square to the wall
    beyond: int


class FloorPlan:
    """Rooms as nodes, doors as edges.

    Ways are measured between the middles of rooms and doors: the way from room to room is always
    the same one, wherever in it somebody stands.

    Args:
        playground: What is planned.
    """

    def __init__(self, playground: PlaygroundCfg) -> None:
        self.rooms = playground.rooms
        numbers = {room.name: number for number, room in enumerate(self.rooms)}
        self._passages: list[list[_Passage]] = [[] for _ in self.rooms]
        for door in playground.doors:
            one, other = (numbers[name] for name in door.rooms)
            out = _way_out(self.rooms[one], self.rooms[other])
            self._passages[one].append(_Passage(door, out, other))
            self._passages[other].append(_Passage(door, -out, one))
        self._routes = [self._routes_from(room) for room in range(len(self.rooms))]

    def room_of(self, place: Floats) -> int:
        """Return the number of the room a place ``(2,)`` or ``(3,)`` is in, or of the nearest."""
        point = float(place[0]), float(place[1])
        return int(np.argmin([room.distance_m(point) for room in self.rooms]))

    def distance_m(self, one: int, other: int) -> float:
        """Return how long the way is from the middle of a room to that of another; inf if none."""
        if one == other:
            return 0.0
        length, _ = self._routes[one].get(other, (math.inf, None))
        return length

    def waypoint(self, place: Floats, goal: Floats, approach: DoorApproach) -> Floats:
        """Return where to walk straight to, on the way to a goal.

        Args:
            place: ``(2,)`` or ``(3,)`` metres, where somebody is.
            goal: Likewise, where it wants to be.
            approach: How it goes through doors.

        Returns:
            ``(2,)`` metres: the goal if it is in the same room; else a point before the next door
            or, for somebody who has the opening straight ahead, one beyond it.

        Raises:
            ValueError: If no doors lead there.
        """
        here, there = self.room_of(place), self.room_of(goal)
        if here == there:
            return np.array([goal[0], goal[1]])
        if there not in self._routes[here]:
            names = self.rooms[here].name, self.rooms[there].name
            raise ValueError(f"no doors lead from {names[0]!r} to {names[1]!r}")
        _, passage = self._routes[here][there]
        return _through(passage, place, approach)

    def waiting_place(self, place: Floats) -> Floats:
        """Return where in a room who stays is in nobody's way to a place ``(2,)`` or ``(3,)``.

        Returns:
            ``(2,)`` metres: of four places near the corners, or halfway there in a small room, the
            one that is farthest from the place and from all doors.
        """
        here = self.room_of(place)
        room = self.rooms[here]
        low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
        inset = np.minimum(_CORNER_M, size / 4.0)
        keep_off = [place[:2], *(passage.door.position_m for passage in self._passages[here])]
        corners = [
            low + np.where([right, far], size - inset, inset) for right in (0, 1) for far in (0, 1)
        ]
        return max(corners, key=lambda corner: min(math.dist(corner, off) for off in keep_off))

    def _routes_from(self, start: int) -> dict[int, tuple[float, _Passage]]:
        """Return length and first door of the shortest way to every other room (Dijkstra 1959)."""
        found: dict[int, tuple[float, _Passage]] = {}
        frontier = [(0.0, start, -1)]  # length, room, number of the first door
        done = set()
        while frontier:
            length, room, first = heapq.heappop(frontier)
            if room in done:
                continue
            done.add(room)
            if room != start:
                found[room] = length, self._passages[start][first]
            for number, passage in enumerate(self._passages[room]):
                more = self._length_m(room, passage)
                first_door = number if room == start else first
                heapq.heappush(frontier, (length + more, passage.beyond, first_door))
        return found

    def _length_m(self, room: int, passage: _Passage) -> float:
        """Return how far it is through a door, from the middle of a room to that of the next."""
        door = passage.door.position_m
        middles = (self.rooms[number].middle_m[:2] for number in (room, passage.beyond))
        return sum(math.dist(door, middle) for middle in middles)


def _way_out(room: RoomCfg, other: RoomCfg) -> Floats:
    """Return the unit vector ``(2,)`` from a room to one beside it, square to the wall between."""
    low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
    other_low, other_size = np.array(other.lower_m[:2]), np.array(other.size_m[:2])
    gaps = np.stack([other_low - low - size, low - other_low - other_size])  # above, below
    side, axis = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    out = np.zeros(2)
    out[axis] = -1.0 if side else 1.0
    return out


def _through(passage: _Passage, place: Floats, approach: DoorApproach) -> Floats:
    """Return where to walk to go through a door, see `FloorPlan.waypoint`."""
    out = passage.out
    right = np.array([out[1], -out[0]])
    middle = np.array(passage.door.position_m)
    half_m = passage.door.width_m / 2.0
    keep_m = min(approach.right_m, half_m / 2.0)
    aside_m = float(right @ (np.array([place[0], place[1]]) - middle))
    if abs(aside_m - keep_m) <= half_m / 3.0:
        return middle + keep_m * right + approach.before_m * out
    return middle + keep_m * right - approach.before_m * out
