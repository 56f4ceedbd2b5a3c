"""Lifting a cube between both palms and holding it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from veca_marl.envs.experts.control.carrying import quarter_yaw
from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import reaching
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop

# less bent than for carrying, since the spine supports both extended arms for seconds
UPRIGHT, BENT = reaching(15.0, 20.0), reaching(30.0, 20.0)
_CLEARANCE_M = 0.022  # between each open palm and the cube
_SQUEEZE_M = 0.03  # each palm's target is this far inside the cube, which sets the grip force
_ABOVE = np.array([0.0, 0.0, 0.07])  # the hands approach from here
# The palms close in front of the centre and below it: they press the cube toward the body and
# slide up along it.
_GRIP_OFFSET = np.array([0.02, 0.0, -0.012])
_LIFT_MPS = 0.125
_LOST_M = 0.06  # distance from the middle between the palms at which the cube counts as lost
# longest durations of approach and lowering; durations of closing and opening
_APPROACH_S, _LOWER_S, _CLOSE_S, _OPEN_S = 1.4, 1.2, 0.8, 0.48


def lift(child: Humanoid, palms: PalmMotion, toy: Prop, height_m: float) -> Iterator[Floats]:
    """Yield target angles ``(82,)`` rad, one array per step: grip, lift and hold a cube.

    The sequence never ends; it starts again when the cube is lost.

    Args:
        child: The body that lifts.
        palms: Controller of its hands.
        toy: The cube.
        height_m: Height to which the palms lift it.
    """
    edge = float(toy.cfg.size_m[0])
    wide, tight = edge + 2 * _CLEARANCE_M, edge - 2 * _SQUEEZE_M
    while True:
        yaw = quarter_yaw(toy)
        for offset, most_s in ((_ABOVE, _APPROACH_S), (_GRIP_OFFSET, _LOWER_S)):
            for _ in range(palms.steps(most_s)):
                goal = Grip(toy.position + offset, wide, yaw)
                yield palms.move(goal)
                if palms.is_at(goal):
                    break
        place = toy.position + _GRIP_OFFSET
        yield from palms.during(Grip(place, tight, yaw), _CLOSE_S)
        up = np.array([place[0], place[1], height_m])
        while slip_m(child, toy) < _LOST_M:
            yield palms.move(Grip(up, tight, yaw), _LIFT_MPS)
        for _ in range(palms.steps(_OPEN_S)):
            yield palms.move(Grip(child.palms().mean(axis=0), wide, yaw))


def slip_m(child: Humanoid, toy: Prop) -> float:
    """Return the distance of a cube from the middle between the palms, metres."""
    return float(np.linalg.norm(child.palms().mean(axis=0) - toy.position))
