"""Walkers among walkers: nobody walks through anybody, whoever is asked first.

Bodies without mass do not meet in Bullet. All walkers of a world therefore take their steps at
once: each goes where it wants to, then those who overlap part, half of the way each, and walls
have the last word. What a pair does depends on where both are, not on who joined first.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numba import njit

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.world import World

# a pair that a wall holds on one side closes half of its overlap in each
_ROUNDS = 16
_TOUCH_M = 1e-7


class Member(Protocol):
    """A walker as the crowd sees it."""

    def reset(self) -> None:
        """See `Mover`."""
        ...

    def before_step(self) -> None:
        """See `Mover`."""
        ...

    def mirror(self) -> None:
        """See `Mover`."""
        ...

    @property
    def radius_m(self) -> float:
        """How near others come to its axis."""
        ...

    def stride(self, substep_s: float) -> tuple[float, float]:
        """Return where it wants to be after this physics step, metres on the floor plan."""
        ...

    def squeeze(self, x: float, y: float) -> tuple[float, float]:
        """Return where walls and heavy things let it stand near a place."""
        ...

    def stand(self, x: float, y: float, substep_s: float) -> None:
        """Be there at the end of this physics step."""
        ...


class Crowd:
    """All walkers of one world. It moves in the world in their stead."""

    def __init__(self) -> None:
        self._members: list[Member] = []
        self._radii: Floats = np.zeros(0)
        self._places: Floats = np.zeros((0, 2))
        self._shoves: Floats = np.zeros((0, 2))

    def join(self, member: Member) -> None:
        """Let one more in."""
        self._members.append(member)
        self._radii = np.array([one.radius_m for one in self._members])
        self._places = np.zeros((len(self._members), 2))
        self._shoves = np.zeros((len(self._members), 2))

    def reset(self) -> None:
        """See `Mover`."""
        for member in self._members:
            member.reset()

    def before_step(self) -> None:
        """See `Mover`."""
        for member in self._members:
            member.before_step()

    def before_substep(self, substep_s: float) -> None:
        """Let everybody take a step, and part those who stand in each other."""
        places, shoves = self._places, self._shoves
        for index, member in enumerate(self._members):
            places[index] = member.squeeze(*member.stride(substep_s))
        for _ in range(_ROUNDS):
            if not part(places, self._radii, shoves):
                break
            for index in np.flatnonzero(shoves.any(axis=1)).tolist():
                x, y = places[index] + shoves[index]
                places[index] = self._members[index].squeeze(float(x), float(y))
        for (x, y), member in zip(places.tolist(), self._members, strict=True):
            member.stand(x, y, substep_s)

    def mirror(self) -> None:
        """See `Mover`."""
        for member in self._members:
            member.mirror()


def crowd_of(world: World) -> Crowd:
    """Return the crowd of a world; it comes with the first walker."""
    for mover in world.movers:
        if isinstance(mover, Crowd):
            return mover
    crowd = Crowd()
    world.attach(crowd)
    return crowd


@njit(cache=True)
def part(places: Floats, radii: Floats, shoves: Floats) -> bool:
    """Write by how much everybody gives way to everybody at once.

    Of two who overlap each gives way by half; who overlaps with several gives each of them its
    share, so that nobody is thrown further than the deepest overlap (Jacobi's method, damped).

    Args:
        places: ``(n, 2)`` metres on the floor plan.
        radii: ``(n,)`` metres.
        shoves: ``(n, 2)`` metres; overwritten.

    Returns:
        Whether any two overlap.
    """
    n = len(places)
    shoves[:] = 0.0
    counts = np.zeros(n)
    for i in range(n):
        for j in range(i):
            if _overlap(places, radii, i, j) > _TOUCH_M:
                counts[i] += 1.0
                counts[j] += 1.0
    for i in range(n):
        for j in range(i):
            overlap = _overlap(places, radii, i, j)
            if overlap <= _TOUCH_M:
                continue
            dx, dy = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
            distance = math.hypot(dx, dy)
            if distance < 1e-9:  # on one spot no way is better than another: the elder goes west
                dx, dy, distance = 1.0, 0.0, 1.0
            share = 0.5 * overlap / (distance * max(counts[i], counts[j]))
            shoves[i, 0] += dx * share
            shoves[i, 1] += dy * share
            shoves[j, 0] -= dx * share
            shoves[j, 1] -= dy * share
    return bool(counts.any())


@njit(cache=True)
def _overlap(places: Floats, radii: Floats, i: int, j: int) -> float:
    dx, dy = places[i, 0] - places[j, 0], places[i, 1] - places[j, 1]
    return float(radii[i] + radii[j] - math.hypot(dx, dy))
