"""Floor plan of a house: rooms and doors as a graph, and shortest paths through it."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import DoorCfg, PlaygroundCfg, RoomCfg

_CORNER_M = 0.7  # distance of a waiting place in a corner from both walls


class DoorApproach(NamedTuple):
    """How a body passes through doors.

    Attributes:
        before_m: Distance from the door of the points in front of it and beyond it that the path
            leads through.
        right_m: Lateral offset to the right of the middle, limited by the width of the door, that
            keeps bodies apart that come from opposite sides.
    """

    before_m: float
    right_m: float


class _Passage(NamedTuple):
    """A door, seen from one of its two rooms.

    Attributes:
        door: The door.
        out: Unit vector out of the room, normal to the wall, ``(2,)``.
        beyond: Number of the room on the other side.
    """

    door: DoorCfg
    out: Floats
    beyond: int


class FloorPlan:
    """Rooms as nodes and doors as edges of a graph.

    Lengths are measured between the middles of rooms and doors, so that the shortest path between
    two rooms does not depend on the position within them.

    Args:
        playground: The house.

    Attributes:
        rooms: The rooms, by number.
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
        """Return the number of the room that contains a place, or of the nearest one."""
        point = float(place[0]), float(place[1])
        return int(np.argmin([room.distance_m(point) for room in self.rooms]))

    def distance_m(self, one: int, other: int) -> float:
        """Return the length of the shortest path between the middles of two rooms; inf if none."""
        if one == other:
            return 0.0
        length, _ = self._routes[one].get(other, (math.inf, None))
        return length

    def waypoint(self, place: Floats, goal: Floats, approach: DoorApproach) -> Floats:
        """Return the next point of the shortest path to a goal that can be reached straight.

        Args:
            place: Present place, ``(2,)`` or ``(3,)`` metres.
            goal: ``(2,)`` or ``(3,)`` metres.
            approach: How to pass through doors.

        Returns:
            ``(2,)`` metres: the goal if it is in the same room; otherwise a point in front of the
            next door or, if the opening is straight ahead, a point beyond it.

        Raises:
            ValueError: If no path exists.
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
        """Return a waiting place near a place that leaves the paths to it free.

        Args:
            place: ``(2,)`` or ``(3,)`` metres.

        Returns:
            ``(2,)`` metres: of four places near the corners of the room (in a small room halfway
            to the corners), the one with the greatest distance from the place and from all doors.
        """
        here = self.room_of(place)
        room = self.rooms[here]
        low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
        inset = np.minimum(_CORNER_M, size / 4.0)
        doors = [np.array(passage.door.position_m) for passage in self._passages[here]]
        avoided = [place[:2], *doors]
        corners = [
            low + np.where([right, far], size - inset, inset) for right in (0, 1) for far in (0, 1)
        ]
        return max(corners, key=lambda corner: min(math.dist(corner, other) for other in avoided))

    def _routes_from(self, start: int) -> dict[int, tuple[float, _Passage]]:
        """Return length and first door of the shortest path to every other room (Dijkstra 1959)."""
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
        """Return the length of the path through a door between the middles of its rooms."""
        door = passage.door.position_m
        middles = (self.rooms[number].middle_m[:2] for number in (room, passage.beyond))
        return sum(math.dist(door, middle) for middle in middles)


def _way_out(room: RoomCfg, other: RoomCfg) -> Floats:
    """Return the unit normal ``(2,)`` of the wall between two rooms, towards the second."""
    low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
    other_low, other_size = np.array(other.lower_m[:2]), np.array(other.size_m[:2])
    gaps = np.stack([other_low - low - size, low - other_low - other_size])  # above, below
    side, axis = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    out = np.zeros(2)
    out[axis] = -1.0 if side else 1.0
    return out


def _through(passage: _Passage, place: Floats, approach: DoorApproach) -> Floats:
    """Return the next point of a path through a door, see `FloorPlan.waypoint`."""
    out = passage.out
    right = np.array([out[1], -out[0]])
    middle = np.array(passage.door.position_m)
    half_m = passage.door.width_m / 2.0
    keep_m = min(approach.right_m, half_m / 2.0)
    aside_m = float(right @ (np.array([place[0], place[1]]) - middle))
    if abs(aside_m - keep_m) <= half_m / 3.0:
        return middle + keep_m * right + approach.before_m * out
    return middle + keep_m * right - approach.before_m * out
