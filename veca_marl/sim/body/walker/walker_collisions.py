"""Collisions between walkers, independent of the order in which they were added to the world.

Walkers are kinematic and have no mass, so Bullet does not keep them apart. All walkers of a world
therefore move at once: each proposes a position, overlapping pairs are separated by half of their
overlap each, and walls and heavy things take precedence. So are pairs that press a light thing
between them. The result for a pair depends on the positions of both and not on which of them was
added first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from veca_marl.sim.body.walker.actions.verb_part import VerbUser, apply_verbs
from veca_marl.sim.body.walker.collisions.separation import Footprint, separate
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World

# when a wall stops one walker of a pair, each round removes half of the remaining overlap
_ROUNDS = 16


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
    def footprint(self) -> Footprint:
        """Its capsule on the floor plan."""
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
        self._half_axes, self._positions, self._corrections = np.zeros((3, 0, 2))

    @property
    def capsule_ids(self) -> list[int]:
        """PyBullet's ids of the capsules of all walkers."""
        return [id_ for walker in self._walkers for id_ in walker.capsule_ids]

    def add(self, walker: CollidingWalker) -> None:
        """Add a walker."""
        self._walkers.append(walker)
        count = len(self._walkers)
        self._radii = np.zeros(count)
        self._half_axes, self._positions, self._corrections = np.zeros((3, count, 2))

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
        positions = self._positions
        for index, walker in enumerate(self._walkers):
            positions[index] = walker.resolve_contacts(*walker.proposed_position(substep_s))
        if len(self._walkers) > 1:
            self._separate(positions)
        for (x, y), walker in zip(positions.tolist(), self._walkers, strict=True):
            walker.set_position(x, y, substep_s)

    def _separate(self, positions: Floats) -> None:
        """Move walkers apart that overlap or press a thing between them.

        Args:
            positions: ``(n, 2)`` metres; changed in place.
        """
        corrections = self._corrections
        for index, walker in enumerate(self._walkers):
            self._radii[index], self._half_axes[index] = walker.footprint
        for _ in range(_ROUNDS):
            overlap = separate(positions, self._half_axes, self._radii, corrections)
            if not (self._make_room(corrections) or overlap):
                break
            for index in np.flatnonzero(corrections.any(axis=1)).tolist():
                x, y = positions[index] + corrections[index]
                positions[index] = self._walkers[index].resolve_contacts(float(x), float(y))

    def _make_room(self, corrections: Floats) -> bool:
        """Add the displacements that release what walkers press together; return if there are any.

        Args:
            corrections: ``(n, 2)`` metres.
        """
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
