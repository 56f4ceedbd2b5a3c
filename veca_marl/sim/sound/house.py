"""Several rooms with walls between them: who hears whom through what.

Image sources are right inside one box. Who is in the same room as a source hears it with that
room's reflections; who is in another hears the direct sound alone, weakened by every wall that the
straight line crosses. Through an open door the line crosses none, so nothing is lost: a bold rule,
without diffraction round the frame, but one that a listener can learn. Changes of room and of the
number of walls are faded over one control step, as all changes of filters are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from veca_marl.sim.geometry.pose import Floats, Pose
from veca_marl.sim.sound.acoustics import Room
from veca_marl.sim.sound.propagation import OneRoom

TRANSMISSION_LOSS_DB = 30.0
"""A limp partition of 15 kg/m2 at 500 Hz by the field-incidence mass law: 20 log10(500 x 15) - 47
= 30.5 dB. Authors differ in its constant (Ebbitt & Hansen 2007, Mass Law - Calculations and
Measurements, SAE 2007-01-2201); 47 is one of those in use, 5 dB below normal incidence, which is
20 log10(pi f m / (rho c)) with rho c = 415 kg/(m2 s). The same at all frequencies: that real walls
muffle, too, is left out."""

_GRAZE_M = 1e-6


class House:
    """Rooms and walls. Serves a `SoundField` as its surroundings.

    Attributes:
        size: ``(3,)`` metres, the box round all rooms.
        spread_m: See `Surroundings`.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        image_order: int = 1,
        transmission_loss_db: float = TRANSMISSION_LOSS_DB,
    ) -> None:
        """Put rooms beside each other; walls come later.

        Args:
            rooms: One or more; a place outside all belongs to the nearest.
            image_order: Greatest number of reflections inside a room.
            transmission_loss_db: What each wall between takes away.
        """
        if not rooms:
            raise ValueError("a house needs at least one room")
        if not (np.isfinite(transmission_loss_db) and transmission_loss_db >= 0.0):
            raise ValueError(f"transmission_loss_db={transmission_loss_db} must be finite, 0 or up")
        self._rooms = [OneRoom(room, image_order) for room in rooms]
        self._lower = np.array([room.lower for room in rooms])
        self._upper = np.array([room.lower + room.size for room in rooms])
        self.size: Floats = self._upper.max(axis=0) - self._lower.min(axis=0)
        self.spread_m = max(room.spread_m for room in self._rooms)
        self._wall_gain = 10.0 ** (-transmission_loss_db / 20.0)
        self._centres, self._halves = np.zeros((0, 3)), np.zeros((0, 3))
        self._rotations = np.zeros((0, 3, 3))

    def add_wall(self, centre: ArrayLike, rotation: ArrayLike, half: ArrayLike) -> None:
        """Put up a wall that stays: a box.

        Args:
            centre: ``(3,)`` metres.
            rotation: ``(3, 3)`` its frame to the world frame.
            half: ``(3,)`` metres, half its edges.
        """
        self._centres = np.vstack([self._centres, centre])
        self._halves = np.vstack([self._halves, half])
        self._rotations = np.concatenate([self._rotations, np.asarray(rotation)[None]])

    def room_of(self, position: Floats) -> int:
        """Return the number of the room a point ``(3,)`` is in, or else of the nearest."""
        return int(nearest_box(position, self._lower, self._upper))

    def walls_between(self, one: Floats, other: Floats) -> int:
        """Return how many walls the straight line between two points ``(3,)`` crosses."""
        return int(crossings(one, other, self._centres, self._rotations, self._halves))

    def arrivals(self, source: Floats, head: Pose) -> tuple[Floats, Floats]:
        """See `Surroundings`."""
        room = self.room_of(head.position)
        if self.room_of(source) == room:
            return self._rooms[room].arrivals(source, head)
        direct: Floats = ((source - head.position) @ head.rotation)[None]
        gain = self._wall_gain ** self.walls_between(source, head.position)
        return direct, np.array([gain])


@njit(cache=True)
def nearest_box(point: Floats, lower: Floats, upper: Floats) -> int:
    """Return which of the boxes ``(n, 3)`` is nearest to a point ``(3,)``, the first of equals."""
    nearest, least = 0, np.inf
    for n in range(len(lower)):
        outside = 0.0
        for axis in range(3):
            out = max(lower[n, axis] - point[axis], point[axis] - upper[n, axis], 0.0)
            outside += out * out
        if outside < least:
            nearest, least = n, outside
    return nearest


@njit(cache=True)
def crossings(
    one: Floats, other: Floats, centres: Floats, rotations: Floats, halves: Floats
) -> int:
    """Count the boxes that a segment passes through (slabs: Kay & Kajiya, SIGGRAPH 1986).

    Args:
        one: ``(3,)`` metres.
        other: ``(3,)`` metres.
        centres: ``(n, 3)`` metres.
        rotations: ``(n, 3, 3)`` frames of the boxes to the world frame.
        halves: ``(n, 3)`` metres.
    """
    length = np.sqrt(((other - one) ** 2).sum())
    count = 0
    for n in range(len(centres)):
        enter, leave = 0.0, 1.0
        for axis in range(3):
            begin = way = 0.0
            for k in range(3):
                begin += (one[k] - centres[n, k]) * rotations[n, k, axis]
                way += (other[k] - one[k]) * rotations[n, k, axis]
            half = halves[n, axis]
            if abs(way) < 1e-12:
                if abs(begin) > half - _GRAZE_M:
                    leave = -1.0
                continue
            first, second = (-half - begin) / way, (half - begin) / way
            enter = max(enter, min(first, second))
            leave = min(leave, max(first, second))
        if (leave - enter) * length > _GRAZE_M:
            count += 1
    return count
