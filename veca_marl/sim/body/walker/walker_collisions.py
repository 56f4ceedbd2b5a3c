"""Collisions between walkers, independent of the order in which they were added to the world.

A walker is a disc when it stands, and a stadium along its heading when it crawls: all places within
a radius of an axis, which for a disc is a point.

Walkers are kinematic and have no mass, so Bullet does not keep them apart. All walkers of a world
therefore move at once: each proposes a position, overlapping pairs are separated by half of their
overlap each, and walls and heavy things take precedence. So are pairs that press a light thing
between them. The result for a pair depends on the positions of both and not on which of them was
added first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from veca_marl.sim.body.walker.actions import VerbUser, apply_verbs
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import compiled, kernel
from veca_marl.sim.physics import World

_TOLERANCE_M = 1e-7


class Footprint(NamedTuple):
    """A walker on the floor plan, about its position.

    Attributes:
        radius_m: Radius about its axis.
        half_axis_m: From its position to an end of the axis, ``(x, y)``; ``(0, 0)`` for a disc.
    """

    radius_m: float
    half_axis_m: tuple[float, float]


@compiled
def separate(positions: Floats, half_axes: Floats, radii: Floats, corrections: Floats) -> bool:
    """Write the displacements that separate all overlapping pairs.

    Each one of a pair moves by half of the overlap, divided by the larger number of overlaps that
    one of the two has: a damped Jacobi iteration, in which none moves by more than its deepest
    overlap. Nothing is turned.

    Args:
        positions: ``(n, 2)`` metres on the floor plan.
        half_axes: ``(n, 2)`` metres, see `Footprint`.
        radii: ``(n,)`` metres.
        corrections: ``(n, 2)`` metres; overwritten.

    Returns:
        Whether any two overlap.
    """
    n = len(positions)
    corrections[:] = 0.0
    counts = _overlap_counts(positions, half_axes, radii)
    for i in range(n):
        for j in range(i):
            dx, dy, distance, overlap = _overlap(positions, half_axes, radii, i, j)
            if overlap <= _TOLERANCE_M:
                continue
            share = 0.5 * overlap / (distance * max(counts[i], counts[j]))
            corrections[i, 0] += dx * share
            corrections[i, 1] += dy * share
            corrections[j, 0] -= dx * share
            corrections[j, 1] -= dy * share
    return bool(counts.any())


@compiled
def _overlap_counts(positions: Floats, half_axes: Floats, radii: Floats) -> Floats:
    """Return for each walker how many others it overlaps, ``(n,)``."""
    counts = np.zeros(len(positions))
    for i in range(len(positions)):
        for j in range(i):
            if _overlap(positions, half_axes, radii, i, j)[3] > _TOLERANCE_M:
                counts[i] += 1.0
                counts[j] += 1.0
    return counts


@kernel
def _overlap(
    positions: Floats, half_axes: Floats, radii: Floats, i: int, j: int
) -> tuple[float, float, float, float]:
    """Return the vector from `j` to `i` (x, y and length) and their overlap, metres.

    The vector is that between the nearest points of the axes. Where these cross it is that between
    the centres, and the x axis where the centres coincide.
    """
    dx, dy = positions[i, 0] - positions[j, 0], positions[i, 1] - positions[j, 1]
    width = radii[i] + radii[j]
    if _cross(dx, dy, half_axes[i], half_axes[j]):
        distance = math.hypot(dx, dy)
        if distance < 1e-9:
            return 1.0, 0.0, 1.0, width
        return dx, dy, distance, width
    dx, dy = _nearest(dx, dy, half_axes[i], half_axes[j])
    distance = math.hypot(dx, dy)
    return dx, dy, distance, width - distance


@kernel
def _cross(dx: float, dy: float, one: Floats, other: Floats) -> bool:
    """Return whether two axes cross; points cross where they coincide.

    Args:
        dx: From the centre of the other axis to that of the one, metres.
        dy: Likewise.
        one: ``(2,)`` half of the one axis, metres.
        other: ``(2,)`` half of the other.
    """
    turned = one[0] * other[1] - one[1] * other[0]
    if abs(turned) < 1e-12:  # parallel, or points
        nearest_x, nearest_y = _nearest(dx, dy, one, other)
        return math.hypot(nearest_x, nearest_y) < 1e-9
    along_one = (other[0] * dy - other[1] * dx) / turned
    along_other = (one[0] * dy - one[1] * dx) / turned
    return bool(abs(along_one) <= 1.0 and abs(along_other) <= 1.0)


@kernel
def _nearest(dx: float, dy: float, one: Floats, other: Floats) -> tuple[float, float]:
    """Return the shortest vector from the other axis to the one, which do not cross; see `_cross`.

    One of the two points is an end of an axis.
    """
    best_x, best_y = dx, dy
    best = math.inf
    for end in (-1.0, 1.0):
        # from the other axis to an end of the one
        x, y = dx + end * one[0], dy + end * one[1]
        share = _share(x, y, other)
        x, y = x - share * other[0], y - share * other[1]
        if x * x + y * y < best:
            best, best_x, best_y = x * x + y * y, x, y
        # from an end of the other axis to the one
        x, y = dx - end * other[0], dy - end * other[1]
        share = _share(-x, -y, one)
        x, y = x + share * one[0], y + share * one[1]
        if x * x + y * y < best:
            best, best_x, best_y = x * x + y * y, x, y
    return best_x, best_y


@kernel
def _share(x: float, y: float, half_axis: Floats) -> float:
    """Return the place on an axis nearest to a point relative to its centre, in [-1, 1]."""
    squared = half_axis[0] * half_axis[0] + half_axis[1] * half_axis[1]
    if squared == 0.0:
        return 0.0
    share = (x * half_axis[0] + y * half_axis[1]) / squared
    return float(min(1.0, max(-1.0, share)))


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

    @property
    def is_clear(self) -> bool:
        """Whether nothing but other walkers can be met in this agent step."""
        ...

    @property
    def swept_circle(self) -> tuple[float, float, float]:
        """What it can touch on the floor plan in this agent step: centre and radius, metres."""
        ...

    def walk_freely(self) -> None:
        """Walk for the whole agent step, in which nothing can be met."""
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
    """Moves all walkers of one world; the world attaches this object instead of each walker.

    A walker that can meet nothing in an agent step walks through all of it at once. The others move
    by physics steps.
    """

    def __init__(self) -> None:
        self._walkers: list[CollidingWalker] = []
        self._hindered: list[CollidingWalker] = []
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
        hindered = _meeting(self._walkers)
        self._hindered = [
            w for w, is_hindered in zip(self._walkers, hindered, strict=True) if is_hindered
        ]
        for walker, is_hindered in zip(self._walkers, hindered, strict=True):
            if not is_hindered:
                walker.walk_freely()

    @property
    def needs_physics(self) -> bool:
        """See `Mover`: those that can meet nothing need none."""
        return bool(self._hindered)

    def before_substep(self, substep_s: float) -> None:
        """Move walkers by one physics step and separate those that overlap."""
        if not self._hindered:
            return
        positions = self._positions[: len(self._hindered)]
        for index, walker in enumerate(self._hindered):
            positions[index] = walker.resolve_contacts(*walker.proposed_position(substep_s))
        if len(self._hindered) > 1:
            self._separate(positions)
        for (x, y), walker in zip(positions.tolist(), self._hindered, strict=True):
            walker.set_position(x, y, substep_s)

    def after_substep(self, substep_s: float) -> None:
        """Do nothing: walkers follow no physics, see `Mover`."""

    def _separate(self, positions: Floats) -> None:
        """Move walkers apart that overlap or press a thing between them.

        Args:
            positions: ``(n, 2)`` metres; changed in place.
        """
        count = len(positions)
        radii, half_axes = self._radii[:count], self._half_axes[:count]
        corrections = self._corrections[:count]
        for index, walker in enumerate(self._hindered):
            radii[index], half_axes[index] = walker.footprint
        for _ in range(_ROUNDS):
            overlap = separate(positions, half_axes, radii, corrections)
            if not (self._make_room(corrections) or overlap):
                break
            for index in np.flatnonzero(corrections.any(axis=1)).tolist():
                x, y = positions[index] + corrections[index]
                positions[index] = self._hindered[index].resolve_contacts(float(x), float(y))

    def _make_room(self, corrections: Floats) -> bool:
        """Add the displacements that release what walkers press together; return if there are any.

        Args:
            corrections: ``(n, 2)`` metres.
        """
        rooms = np.array([walker.room_for_others() for walker in self._hindered])
        corrections += rooms
        return bool(rooms.any())

    def write_frames(self) -> None:
        """See `Mover`."""
        for walker in self._walkers:
            walker.write_frames()


def _meeting(walkers: Sequence[CollidingWalker]) -> list[bool]:
    """Return for each walker whether it may meet anything in this agent step."""
    meeting = [not walker.is_clear for walker in walkers]
    circles = [walker.swept_circle for walker in walkers] if len(walkers) > 1 else []
    for one, other in itertools.combinations(range(len(circles)), 2):
        (x, y, radius_m), (other_x, other_y, other_m) = circles[one], circles[other]
        if math.hypot(x - other_x, y - other_y) < radius_m + other_m:
            meeting[one] = meeting[other] = True
    return meeting


def walker_collisions(world: World) -> WalkerCollisions:
    """Return the collision handling of a world; it is attached with the first walker."""
    for mover in world.movers:
        if isinstance(mover, WalkerCollisions):
            return mover
    collisions = WalkerCollisions()
    world.attach(collisions)
    return collisions
