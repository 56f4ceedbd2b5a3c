"""Expert of RotateCube: turn the hand with the cube on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.tasks.objects.rotate_cube import SHOULDER, RotateCube
from veca_marl.sim.body.humanoid.postures import OFFERING
from veca_marl.sim.geometry import Floats, heading_rad

_GAIN_PER_S = 1.25  # change of the target angles, as a share of the remaining angle
_MAX_SPEED_RADPS = math.radians(37.5)  # faster, the cube slides off
_JOINTS = (SHOULDER, "r_hand.radial_deviation")
_TILT_JOINT = "r_upper_arm.flexion"


@register_expert("RotateCube")
class RotateCubeExpert(Expert[RotateCube]):
    """Turns shoulder and wrist until the cube on the palm has reached its target orientation.

    Flexion of the upper arm keeps the palm level meanwhile. The fingers do not move. Reads the
    orientation of the cube and of its target from the simulator (privileged). Plays at control
    rates from 21 to 245 Hz: at 15 Hz it drops the cube in most episodes.
    """

    reads = ()
    control_rates_hz = (21, 245)

    def __init__(self, task: RotateCube, player: Player) -> None:
        super().__init__(task, player)
        self._step_s = task.world.clock.step_s
        names = task.child.joint_names
        self._joints = [names.index(name) for name in _JOINTS]
        self._tilt_joint = names.index(_TILT_JOINT)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._angles = self.task.child.posture_angles(OFFERING)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        turn = self.task.target @ self.task.cube.rotation.T
        # for the right arm of a child on its back, abduction and radial deviation turn to the right
        self._angles[self._joints] -= self._change(heading_rad(turn)) / len(self._joints)
        # the arm points to the right (-y): its flexion tilts what lies on the palm about y, by the
        # angle in the antisymmetric part of a rotation that is small but for the heading
        self._angles[self._tilt_joint] -= self._change((turn[0, 2] - turn[2, 0]) / 2)
        return self._angles

    def _change(self, error_rad: float) -> float:
        """Return the change of target angles in a step."""
        most_rad = _MAX_SPEED_RADPS * self._step_s
        return float(np.clip(_GAIN_PER_S * self._step_s * error_rad, -most_rad, most_rad))
