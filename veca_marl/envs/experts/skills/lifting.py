"""Lifting a toy between both palms, and holding it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from veca_marl.envs.experts.skills.carrying import Carrier, Grip, quarter_yaw
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import reaching
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.props import Prop

# less bent than a child that carries: the spine bears both arms stretched out for seconds
UPRIGHT, BENT = reaching(15.0, 20.0), reaching(30.0, 20.0)
_CLEAR_M = 0.022  # open palms are so far away from the toy, each
_SQUEEZE_M = 0.03  # palms press as if they wanted to come so far into it, each
_ABOVE = np.array([0.0, 0.0, 0.07])  # the hands come from so far above it
# the palms close ahead of its middle and below: they press it toward the child and slide up
_AT = np.array([0.02, 0.0, -0.012])
_LIFTING_M = 0.005  # per step
_LOST_M = 0.06  # farther from the middle of the palms it has slipped away


def lift(child: Humanoid, carrier: Carrier, toy: Prop, height_m: float) -> Iterator[Floats]:
    """Yield wishes, one per step and for ever: take a toy, hold it up; if it is lost, once more.

    Args:
        child: Who lifts.
        carrier: Its hands.
        toy: A cube.
        height_m: The palms lift it to this height.
    """
    edge = float(toy.cfg.size_m[0])
    wide, tight = edge + 2 * _CLEAR_M, edge - 2 * _SQUEEZE_M
    while True:
        yaw = quarter_yaw(toy)
        for offset, steps in ((_ABOVE, 35), (_AT, 30)):
            for _ in range(steps):
                goal = Grip(toy.position + offset, wide, yaw)
                yield carrier.move(goal)
                if carrier.is_at(goal):
                    break
        place = toy.position + _AT
        for _ in range(20):
            yield carrier.move(Grip(place, tight, yaw))
        up = np.array([place[0], place[1], height_m])
        while slip_m(child, toy) < _LOST_M:
            yield carrier.move(Grip(up, tight, yaw), _LIFTING_M)
        for _ in range(12):
            yield carrier.move(Grip(child.palms().mean(axis=0), wide, yaw))


def slip_m(child: Humanoid, toy: Prop) -> float:
    """Return how far a toy is from the middle between the palms."""
    return float(np.linalg.norm(child.palms().mean(axis=0) - toy.position))
