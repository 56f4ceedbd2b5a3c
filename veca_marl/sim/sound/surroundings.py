"""The surroundings that sound propagates in: a free field, one room, or a house of several.

Image sources are right inside one box. A listener in the room of a source hears it with the
reflections of that room, one in another room with those of both rooms, see `attenuated_paths`.
Obstacles (walls, leaves of doors, furniture) leave a fraction of the energy of each path in each
octave band, see `diffraction`, at their present poses. Reflections at obstacles are not modelled.
When a listener enters another room, the sound is cross-faded over one control step.
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
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound.attenuated_paths import Reflector, energies_between, energies_inside
from veca_marl.sim.sound.obstacles import Doorway, Obstacles, ScreenSets
from veca_marl.sim.sound.partitions import (
    MOST_LOSS_DB,
    N_BANDS,
    TRANSMISSION_LOSS_DB,
    surface_ratio,
)
from veca_marl.sim.sound.room_acoustics import Room, image_gains, image_lattice, image_sources

_BETWEEN_ROOMS = -1  # `paths_id` of paths between rooms is this and below; rooms have 0 and up


@dataclass(frozen=True)
class Arrivals:
    """The direct sound and the reflections of one source at one head.

    Attributes:
        vectors: ``(K, 3)`` metres from the head to the source and its images, in the head frame.
        gains: ``(K,)`` pressure gains by the walls that reflect it.
        energies: ``(K, N_BANDS)`` fraction of the energy that obstacles leave in each octave band;
            None where they take nothing.
        paths_id: Arrivals of equal id have the same paths in the same order: path k of one
            continues path k of the other.
    """

    vectors: Floats
    gains: Floats
    paths_id: int
    energies: Floats | None = None

    def energy(self) -> Floats:
        """Return what arrives by each path, over the direct sound at 1 m, ``(K, N_BANDS)``."""
        by_distance = self.gains**2 / (self.vectors**2).sum(axis=1)
        left = np.ones((1, N_BANDS)) if self.energies is None else self.energies
        energy: Floats = by_distance[:, None] * left
        return energy

    def same_as(self, other: Arrivals) -> bool:
        """Return whether all numbers are equal."""
        return (
            self.paths_id == other.paths_id
            and bool((self.vectors == other.vectors).all())
            and (self.gains is other.gains or bool((self.gains == other.gains).all()))
            and _equal(self.energies, other.energies)
        )


def _equal(one: Floats | None, other: Floats | None) -> bool:
    if one is None or other is None:
        return one is other
    return bool((one == other).all())


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

    def bounded(self, position: Floats) -> Floats:
        """Return the nearest point ``(3,)`` of sources and heads inside the room."""
        nearest: Floats = np.minimum(np.maximum(position, self._bounds[0]), self._bounds[1])
        return nearest


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
        doorways: Sequence[Doorway] = (),
    ) -> None:
        """Join rooms; there are no obstacles between them yet.

        Args:
            rooms: One or more; a point outside all of them belongs to the nearest.
            image_order: Greatest number of reflections inside a room.
            transmission_loss_db: Loss at 500 Hz of what passes through an obstacle.
            doorways: Openings in the walls between rooms, where these do not reflect.

        Raises:
            ValueError: If there is no room, or the loss is not from 0 to `MOST_LOSS_DB`.
        """
        if not rooms:
            raise ValueError("a house needs at least one room")
        if not 0.0 <= transmission_loss_db <= MOST_LOSS_DB:
            raise ValueError(
                f"transmission_loss_db={transmission_loss_db} must be from 0 to {MOST_LOSS_DB:g}"
            )
        self.obstacles = Obstacles()
        self._rooms = [OneRoom(room, image_order) for room in rooms]
        self._lattice, self._doorways = image_lattice(image_order), list(doorways)
        self._corners = (
            np.array([room.lower for room in rooms]),
            np.array([room.lower + room.size for room in rooms]),
        )
        self._lowest, self._highest = self._corners[0].min(axis=0), self._corners[1].max(axis=0)
        self.size: Floats = self._highest - self._lowest
        longest_m = [room.longest_path_m for room in self._rooms]
        self.longest_path_m = max(float(np.linalg.norm(self.size)), *longest_m)
        if len(rooms) > 1:  # a source outside of the room that reflects it
            self.longest_path_m += float(np.linalg.norm(self.size))
        self._surface_ratio = surface_ratio(transmission_loss_db)
        self._screens_of: tuple[int, ScreenSets] | None = None

    @property
    def changes(self) -> int:
        """See `Surroundings`: the obstacles that were added or moved."""
        return self.obstacles.changes

    def room_of(self, position: Floats) -> int:
        """Return the number of the room that contains a point ``(3,)``, or else of the nearest."""
        return int(nearest_box(position, *self._corners))

    def arrivals(self, source: Floats, head: Pose) -> Arrivals:
        """See `Surroundings`."""
        room, other = self.room_of(source), self.room_of(head.position)
        if room != other:
            return self._arrivals_between(room, other, source, head)
        inside = self._rooms[room].arrivals(source, head)
        energies = self._energies_inside(room, source, head.position, self._lattice)
        return Arrivals(inside.vectors, inside.gains, room, energies)

    def _energies_inside(
        self, room: int, source: Floats, head: Floats, lattice: NDArray[np.int64]
    ) -> Floats | None:
        """Return the energies ``(K, N_BANDS)`` of paths in a room, None if nothing is lost."""
        sets, one = self._screens, self._rooms[room]
        if not (len(sets.inside[room]) or len(sets.openings[room].kinds)):
            return None
        energies: Floats = energies_inside(
            one.bounded(source),
            one.bounded(head),
            self._reflector(room),
            lattice,
            sets.screens,
            self._surface_ratio,
        )
        return None if (energies == 1.0).all() else energies

    def _reflector(self, room: int) -> Reflector:
        """Return a room with what stands in it and the doorways in its walls."""
        sets, walls = self._screens, self._rooms[room].room
        return Reflector(walls.lower, walls.size, sets.inside[room], sets.openings[room])

    def _arrivals_between(self, room: int, other: int, source: Floats, head: Pose) -> Arrivals:
        """Return how a source in one room arrives at a head in another one."""
        source, position = self._clamp(source), self._clamp(head.position)
        energies = self._energies_between(room, other, source, position, self._lattice)
        one, two = self._rooms[room], self._rooms[other]
        images = np.concatenate(
            [
                image_sources(source, one.room.lower, one.room.size, self._lattice),
                image_sources(source, two.room.lower, two.room.size, self._lattice[1:]),
            ]
        )
        paths_id = _BETWEEN_ROOMS - room * len(self._rooms) - other
        gains = np.concatenate([one.gains, two.gains[1:]])
        return Arrivals((images - position) @ head.rotation, gains, paths_id, energies)

    def _energies_between(
        self, room: int, other: int, source: Floats, head: Floats, lattice: NDArray[np.int64]
    ) -> Floats:
        """Return the energies of paths between rooms, see `energies_between`."""
        sets = self._screens
        energies: Floats = energies_between(
            source,
            head,
            self._reflector(room),
            self._reflector(other),
            lattice,
            sets.between,
            self._corners,
            sets.screens,
            self._surface_ratio,
        )
        return energies

    def direct_energy(self, source: Floats, head: Floats) -> Floats:
        """Return which fraction of the energy obstacles leave of the direct sound.

        Args:
            source: ``(3,)`` metres.
            head: ``(3,)`` metres.

        Returns:
            ``(N_BANDS,)`` from 0 to 1, see `partitions.BANDS_HZ`.
        """
        room, other = self.room_of(source), self.room_of(head)
        if room != other:
            ends = self._clamp(source), self._clamp(head)
            between: Floats = self._energies_between(room, other, *ends, image_lattice(0))[0]
            return between
        energies = self._energies_inside(room, source, head, image_lattice(0))
        return np.ones(N_BANDS) if energies is None else energies[0]

    @property
    def _screens(self) -> ScreenSets:
        """The screens at the present poses of the obstacles."""
        if self._screens_of is None or self._screens_of[0] != self.obstacles.changes:
            found = self.obstacles.screens(*self._corners, self._doorways)
            self._screens_of = self.obstacles.changes, found
        return self._screens_of[1]

    def _clamp(self, position: Floats) -> Floats:
        """Return the nearest point in the box round all rooms."""
        nearest: Floats = np.minimum(np.maximum(position, self._lowest), self._highest)
        return nearest


@kernel
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
