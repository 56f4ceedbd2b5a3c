"""Expert of HandRegard."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.posture_transitions import KeyPoses
from veca_marl.envs.tasks.hand_regard import HandRegard
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats

# found by a random search over forward kinematics: both wrists are within 12 degrees of the axes
# of both eyes, and forearms and hands are 29 mm apart
_REGARDING = Posture(
    joints_deg={
        "l_upper_arm.flexion": 57,
        "l_upper_arm.abduction": -24,
        "l_upper_arm.internal_rotation": -59,
        "r_upper_arm.flexion": 61,
        "r_upper_arm.abduction": -25,
        "r_upper_arm.internal_rotation": -20,
        "r_forearm.flexion": 9,
        "neck.flexion": 38,
        "head.flexion": 28,
    }
)
_SPEED_RADPS = 3.0
_GAIN_PER_S = 1.5  # of the integral of the errors of the joint angles
_GREATEST_CORRECTION_RAD = 0.5


@register_expert("HandRegard")
class HandRegardExpert(Expert[HandRegard]):
    """Holds both hands before the eyes, the head tilted towards them.

    A correction that grows with the integral of each joint's error carries the weight of arms and
    head. Reads the joint angles from the simulator; proprioception contains them too.
    """

    reads = ()

    def __init__(self, task: HandRegard, player: Player) -> None:
        super().__init__(task, player)
        self._step_s = task.world.clock.step_s
        self._poses = KeyPoses(task.body, {"regard": _REGARDING}, self._step_s)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._poses.reset()
        self._correction = np.zeros_like(self.task.body.joint_angles())

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        targets = self._poses.toward("regard", _SPEED_RADPS)
        error = targets - self.task.body.joint_angles()
        limit = _GREATEST_CORRECTION_RAD
        change = _GAIN_PER_S * self._step_s * error
        self._correction = np.clip(self._correction + change, -limit, limit)
        return targets + self._correction
