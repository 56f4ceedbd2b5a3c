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

_GAIN = 0.05  # change of the target angles per step, as a share of the remaining angle
_MAX_CHANGE_RAD = math.radians(1.5)  # per step; with a larger one the cube slides off
_JOINTS = (SHOULDER, "r_hand.radial_deviation")


@register_expert("RotateCube")
class RotateCubeExpert(Expert[RotateCube]):
    """Turns shoulder and wrist until the cube on the palm has reached its target orientation.

    It does not move the fingers. Reads the orientation of the cube and of its target from the
    simulator (privileged).
    """

    def __init__(self, task: RotateCube, player: Player) -> None:
        super().__init__(task, player)
        self._joints = [task.child.joint_names.index(name) for name in _JOINTS]

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._angles = self.task.child.posture_angles(OFFERING)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        error_rad = heading_rad(self.task.target @ self.task.cube.rotation.T)
        # for the right arm of a child on its back, abduction and radial deviation turn to the right
        change = np.clip(_GAIN * error_rad, -_MAX_CHANGE_RAD, _MAX_CHANGE_RAD)
        self._angles[self._joints] -= change / len(self._joints)
        return self._angles
