"""Collisions between walkers, independent of the order in which they were added to the world.

Walkers are kinematic and have no mass, so Bullet does not keep them apart. All walkers of a world
therefore move at once: each proposes a position, overlapping pairs are separated by half of their
overlap each, and walls and heavy things take precedence. So are pairs that press a light thing
between them. The result for a pair depends on the positions of both and not on which of them was
added first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numba import njit

from veca_marl.sim.body.walker.actions.verb_part import VerbUser, apply_verbs
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World

# when a wall stops one walker of a pair, each round removes half of the remaining overlap
_ROUNDS = 16
_TOLERANCE_M = 1e-7


class CollidingWalker(VerbUser, Protocol):
    """The interface of a walker that the collision handling uses."""

    def reset(self) -> None:
        """See `Mover`."""
        ...

    def before_step(self) -> None:
        """See `Mover`."""
        ...

    def write_frames(self) -> None:
        """See `Mover`."""
        ...

    @property
    def radius_m(self) -> float:
        """Radius of the capsule."""
        ...

    @property
    def capsule_ids(self) -> Sequence[int]:
        """PyBullet's ids of the capsules of all stances."""
        ...

    def proposed_position(self, substep_s: float) -> tuple[float, float]:
        """Turn; return the position after this physics step without obstacles, metres."""
        ...

    def resolve_contacts(self, x: float, y: float) -> tuple[float, float]:
        """Return the position nearest to ``(x, y)`` outside walls and heavy things."""
        ...

    def room_for_others(self) -> tuple[float, float]:
        """Return by how much it makes room for what it and other walkers press together, metres."""
        ...

    def set_position(self, x: float, y: float, substep_s: float) -> None:
        """Set the position at the end of this physics step."""
        ...


class WalkerCollisions:
    """Moves all walkers of one world; the world attaches this object instead of each walker."""

    def __init__(self) -> None:
        self._walkers: list[CollidingWalker] = []
        self._radii: Floats = np.zeros(0)
        self._positions: Floats = np.zeros((0, 2))
        self._corrections: Floats = np.zeros((0, 2))

    @property
    def capsule_ids(self) -> list[int]:
        """PyBullet's ids of the capsules of all walkers."""
        return [id_ for walker in self._walkers for id_ in walker.capsule_ids]

    def add(self, walker: CollidingWalker) -> None:
        """Add a walker."""
        self._walkers.append(walker)
        self._radii = np.array([one.radius_m for one in self._walkers])
        self._positions = np.zeros((len(self._walkers), 2))
        self._corrections = np.zeros((len(self._walkers), 2))

    def reset(self) -> None:
        """See `Mover`."""
        for walker in self._walkers:
            walker.reset()

    def before_step(self) -> None:
        """See `Mover`. Verbs are applied before anything moves."""
        apply_verbs(self._walkers)
        for walker in self._walkers:
            walker.before_step()

    def before_substep(self, substep_s: float) -> None:
        """Move all walkers by one physics step and separate those that overlap."""
        positions, corrections = self._positions, self._corrections
        for index, walker in enumerate(self._walkers):
            positions[index] = walker.resolve_contacts(*walker.proposed_position(substep_s))
        for _ in range(_ROUNDS):
            overlap = separate(positions, self._radii, corrections)
            if not (self._make_room(corrections) or overlap):
                break
            for index in np.flatnonzero(corrections.any(axis=1)).tolist():
                x, y = positions[index] + corrections[index]
                positions[index] = self._walkers[index].resolve_contacts(float(x), float(y))
        for (x, y), walker in zip(positions.tolist(), self._walkers, strict=True):
            walker.set_position(x, y, substep_s)

    def _make_room(self, corrections: Floats) -> bool:
        """Add the displacements that release what walkers press together; return if there are any.

        Args:
            corrections: ``(n, 2)`` metres.
        """
        if len(self._walkers) == 1:
            return False
        rooms = np.array([walker.room_for_others() for walker in self._walkers])
        corrections += rooms
        return bool(rooms.any())

    def write_frames(self) -> None:
        """See `Mover`."""
        for walker in self._walkers:
            walker.write_frames()


def walker_collisions(world: World) -> WalkerCollisions:
    """Return the collision handling of a world; it is attached with the first walker."""
    for mover in world.movers:
        if isinstance(mover, WalkerCollisions):
            return mover
    collisions = WalkerCollisions()
    world.attach(collisions)
    return collisions


@njit(cache=True)
def separate(positions: Floats, radii: Floats, corrections: Floats) -> bool:
    """Write the displacements that separate all overlapping pairs of discs.

    Each disc of a pair moves by half of the overlap, divided by the larger number of overlaps that
    one of the two has: a damped Jacobi iteration, in which no disc moves by more than its deepest
    overlap.

    Args:
        positions: ``(n, 2)`` metres on the floor plan.
        radii: ``(n,)`` metres.
        corrections: ``(n, 2)`` metres; overwritten.

    Returns:
        Whether any two overlap.
    """
    n = len(positions)
    corrections[:] = 0.0
    counts = _overlap_counts(positions, radii)
    for i in range(n):
        for j in range(i):
            overlap = _overlap(positions, radii, i, j)
            if overlap <= _TOLERANCE_M:
                continue
            dx, dy = positions[i, 0] - positions[j, 0], positions[i, 1] - positions[j, 1]
            distance = math.hypot(dx, dy)
            if distance < 1e-9:  # coincident: the one that was added first moves toward -x
                dx, dy, distance = 1.0, 0.0, 1.0
            share = 0.5 * overlap / (distance * max(counts[i], counts[j]))
            corrections[i, 0] += dx * share
            corrections[i, 1] += dy * share
            corrections[j, 0] -= dx * share
            corrections[j, 1] -= dy * share
    return bool(counts.any())


@njit(cache=True)
def _overlap_counts(positions: Floats, radii: Floats) -> Floats:
    """Return for each disc how many others it overlaps, ``(n,)``."""
    counts = np.zeros(len(positions))
    for i in range(len(positions)):
        for j in range(i):
            if _overlap(positions, radii, i, j) > _TOLERANCE_M:
                counts[i] += 1.0
                counts[j] += 1.0
    return counts


@njit(cache=True)
def _overlap(positions: Floats, radii: Floats, i: int, j: int) -> float:
    dx, dy = positions[i, 0] - positions[j, 0], positions[i, 1] - positions[j, 1]
    return float(radii[i] + radii[j] - math.hypot(dx, dy))
