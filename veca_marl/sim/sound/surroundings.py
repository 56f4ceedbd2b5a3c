"""The surroundings that sound propagates in: a free field or one room; `house` has several."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.kernels import compiled
from veca_marl.sim.sound.partitions import N_BANDS
from veca_marl.sim.sound.room_acoustics import Room, image_gains, image_lattice, image_sources


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


@compiled
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
