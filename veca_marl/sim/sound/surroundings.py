"""The surroundings that sound propagates in: a free field, one room, or a house of several.

Image sources are right inside one box. A listener in the room of a source hears it with the
reflections of that room. A listener in another room hears the direct sound alone. Each path is
attenuated by every obstacle (wall, closed door, wardrobe) that it passes through at that moment. An
open door is no obstacle, see `obstacles`, so that the direct sound through it is not attenuated.
Diffraction round edges and reflections at obstacles are not modelled. When a listener enters
another room or an obstacle moves into a path, the sound is cross-faded over one control step.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.sound.obstacles import Obstacles
from veca_marl.sim.sound.room_acoustics import Room, image_gains, image_lattice, image_sources

TRANSMISSION_LOSS_DB = 30.0
"""A limp partition of 15 kg/m2 at 500 Hz by the field-incidence mass law, 20 log10(500 x 15) - 47
= 30.5 dB. Authors differ in its constant (Ebbitt & Hansen 2007, Mass Law - Calculations and
Measurements, SAE 2007-01-2201); 47 is one of those in use, 5 dB below normal incidence, which is
20 log10(pi f m / (rho c)) with rho c = 415 kg/(m2 s). The same at all frequencies: real walls
attenuate high frequencies more."""

_BETWEEN_ROOMS = -1  # `paths_id` of the direct path from one room to another; rooms have 0 and up


@dataclass(frozen=True)
class Arrivals:
    """The direct sound and the reflections of one source at one head.

    Attributes:
        vectors: ``(K, 3)`` metres from the head to the source and its images, in the head frame.
        gains: ``(K,)`` pressure gains by walls and obstacles.
        paths_id: Arrivals of equal id have the same paths in the same order: path k of one
            continues path k of the other.
    """

    vectors: Floats
    gains: Floats
    paths_id: int

    def same_as(self, other: Arrivals) -> bool:
        """Return whether all numbers are equal."""
        return (
            self.paths_id == other.paths_id
            and bool((self.vectors == other.vectors).all())
            and (self.gains is other.gains or bool((self.gains == other.gains).all()))
        )


class Surroundings(Protocol):
    """The rooms that sound propagates in.

    Attributes:
        longest_path_m: Upper bound of the length of all paths.
        changes: Number of changes that may change the arrivals of the same source at the same head.
    """

    longest_path_m: float

    @property
    def changes(self) -> int:
        """See above."""
        ...

    def arrivals(self, source: Floats, head: Pose) -> Arrivals:
        """Return how a source at ``(3,)`` metres arrives at a head."""
        ...


class FreeField:
    """No walls: the direct sound alone."""

    changes = 0  # see `Surroundings`

    def __init__(self, reach_m: float) -> None:
        """Create a free field.

        Args:
            reach_m: Distance up to which sources are heard.

        Raises:
            ValueError: If it is not positive and finite.
        """
        if not (np.isfinite(reach_m) and reach_m > 0.0):
            raise ValueError(f"reach_m={reach_m} must be positive and finite")
        self.longest_path_m = reach_m

    def arrivals(self, source: Floats, head: Pose) -> Arrivals:
        """See `Surroundings`. A source beyond the reach is silent, with a warning."""
        vector = source - head.position
        distance = float(np.sqrt(vector @ vector))
        if distance <= self.longest_path_m:
            return Arrivals((vector @ head.rotation)[None], np.ones(1), 0)
        warnings.warn(
            f"a source at a distance of {distance:.0f} m is not heard: "
            f"reach_m={self.longest_path_m:g} of the sound field",
            stacklevel=2,
        )
        at_reach = vector * (self.longest_path_m / distance)
        return Arrivals((at_reach @ head.rotation)[None], np.zeros(1), 1)


class OneRoom:
    """One room with its reflections.

    Attributes:
        room: The room. Points outside of it count as the nearest ones inside.
        gains: ``(K,)`` pressure gains by the walls: 1 for the direct sound, then of each image.
        longest_path_m: See `Surroundings`.
    """

    changes = 0  # see `Surroundings`

    def __init__(self, room: Room, image_order: int) -> None:
        self.room = room
        self._lattice = image_lattice(image_order)
        self._bounds = room.bounds()
        self.gains = image_gains(room.beta, self._lattice)
        # along an axis, image n is within (|n| + 1) sizes of every point of the room
        extents = (np.abs(self._lattice) + 1) * room.size
        self.longest_path_m = float(np.linalg.norm(extents, axis=1).max())

    def arrivals(self, source: Floats, head: Pose) -> Arrivals:
        """See `Surroundings`."""
        room = self.room
        vectors = _vectors_to_images(
            source,
            head.position,
            head.rotation,
            *self._bounds,
            room.lower,
            room.size,
            self._lattice,
        )
        return Arrivals(vectors, self.gains, 0)

    def paths_through(
        self, obstacles: Obstacles, source: Floats, head: Floats
    ) -> NDArray[np.int64]:
        """Return how many obstacles each path passes, ``(K,)``; see `Obstacles.inside`."""
        return obstacles.inside(self.room, self._bounds, self._lattice, source, head)


@njit(cache=True)
def _vectors_to_images(
    source: Floats,
    position: Floats,
    rotation: Floats,
    lowest: Floats,
    highest: Floats,
    lower: Floats,
    size: Floats,
    lattice: NDArray[np.int64],
) -> Floats:
    """Return ``(K, 3)`` metres from a head to all images of a source, in the head frame.

    Args:
        source: ``(3,)`` metres, moved to the nearest point within the bounds.
        position: ``(3,)`` metres, that of the head, likewise.
        rotation: ``(3, 3)`` from the head frame to the world's.
        lowest: ``(3,)`` metres, see `Room.bounds`.
        highest: Likewise.
        lower: ``(3,)`` metres, the room's lower corner.
        size: ``(3,)`` metres.
        lattice: ``(K, 3)`` from `image_lattice`.
    """
    inside = np.minimum(np.maximum(source, lowest), highest)
    images = image_sources(inside, lower, size, lattice)
    vectors = np.empty(images.shape)
    for k in range(images.shape[0]):
        for axis in range(3):
            total = 0.0
            for j in range(3):
                head = min(max(position[j], lowest[j]), highest[j])
                total += (images[k, j] - head) * rotation[j, axis]
            vectors[k, axis] = total
    return vectors


class House:
    """Rooms and the obstacles between them. Serves a `SoundField` as its surroundings.

    Attributes:
        size: ``(3,)`` metres, the box round all rooms.
        longest_path_m: See `Surroundings`.
        obstacles: The walls and doors between the rooms; their owners add and move them.
    """

    def __init__(
        self,
        rooms: Sequence[Room],
        image_order: int = 1,
        transmission_loss_db: float = TRANSMISSION_LOSS_DB,
    ) -> None:
        """Join rooms; there are no obstacles between them yet.

        Args:
            rooms: One or more; a point outside all of them belongs to the nearest.
            image_order: Greatest number of reflections inside a room.
            transmission_loss_db: Attenuation by each obstacle.

        Raises:
            ValueError: If there is no room or the loss is negative or not finite.
        """
        if not rooms:
            raise ValueError("a house needs at least one room")
        if not (np.isfinite(transmission_loss_db) and transmission_loss_db >= 0.0):
            raise ValueError(f"transmission_loss_db={transmission_loss_db} must be finite, 0 or up")
        self.obstacles = Obstacles()
        self._rooms = [OneRoom(room, image_order) for room in rooms]
        self._lower = np.array([room.lower for room in rooms])
        self._upper = np.array([room.lower + room.size for room in rooms])
        self._lowest, self._highest = self._lower.min(axis=0), self._upper.max(axis=0)
        self.size: Floats = self._highest - self._lowest
        longest_m = [room.longest_path_m for room in self._rooms]
        self.longest_path_m = max(float(np.linalg.norm(self.size)), *longest_m)
        self._obstacle_gain = 10.0 ** (-transmission_loss_db / 20.0)

    @property
    def changes(self) -> int:
        """See `Surroundings`: the obstacles that were added or moved."""
        return self.obstacles.changes

    def room_of(self, position: Floats) -> int:
        """Return the number of the room that contains a point ``(3,)``, or else of the nearest."""
        return int(nearest_box(position, self._lower, self._upper))

    def obstacles_between(self, one: Floats, other: Floats) -> int:
        """Return how many obstacles the straight line between two points ``(3,)`` passes."""
        return self.obstacles.between(one, other)

    def arrivals(self, source: Floats, head: Pose) -> Arrivals:
        """See `Surroundings`."""
        room = self.room_of(head.position)
        if self.room_of(source) == room:
            inside = self._rooms[room].arrivals(source, head)
            gains = self._attenuated(inside.gains, self._rooms[room], source, head.position)
            return Arrivals(inside.vectors, gains, room)
        source, position = self._clamp(source), self._clamp(head.position)
        direct: Floats = ((source - position) @ head.rotation)[None]
        gain = self._obstacle_gain ** self.obstacles_between(source, position)
        return Arrivals(direct, np.array([gain]), _BETWEEN_ROOMS)

    def _attenuated(self, gains: Floats, one: OneRoom, source: Floats, head: Floats) -> Floats:
        """Return the gains of all paths in a room after the obstacles in it."""
        if not self.obstacles.reach_into(one.room):
            return gains
        counts = one.paths_through(self.obstacles, source, head)
        return gains * self._obstacle_gain**counts if counts.any() else gains

    def _clamp(self, position: Floats) -> Floats:
        """Return the nearest point in the box round all rooms."""
        nearest: Floats = np.minimum(np.maximum(position, self._lowest), self._highest)
        return nearest


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
