"""Expert of SelfTouch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.arm_kinematics import ArmKinematics, Palms
from veca_marl.envs.experts.control.posture_transitions import KeyPoses
from veca_marl.envs.tasks.self_touch import SelfTouch
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats

# regions that the left and the right hand visit at the same time, and the posture of the legs
_VISITS = (
    ("r_hand", "l_hand", "lie"),
    ("chest", "spine", "lie"),
    ("spine", "chest", "lie"),
    ("r_forearm", "pelvis", "lie"),
    ("pelvis", "l_forearm", "lie"),
    ("head", "l_upper_arm", "lie"),
    ("r_upper_arm", "head", "lie"),
    ("neck", "r_thigh", "knees"),
    ("l_thigh", "neck", "knees"),
    ("r_thigh", "l_thigh", "knees"),
    ("l_shank", "r_shank", "knees"),
    ("l_foot", "r_foot", "feet"),
    ("r_shank", "l_foot", "cross"),
    ("r_foot", "l_shank", "cross"),
)
_LEGS = {
    "lie": Posture(joints_deg={"thigh.flexion": 60, "thigh.abduction": 25, "shank.flexion": 90}),
    "knees": Posture(
        joints_deg={"thigh.flexion": 115, "thigh.abduction": 15, "shank.flexion": 120}
    ),
    "feet": Posture(
        joints_deg={
            "thigh.flexion": 130,
            "thigh.abduction": 35,
            "shank.flexion": 95,
            "spine.flexion": 20,
            "chest.flexion": 20,
        }
    ),
    "cross": Posture(
        joints_deg={
            "thigh.flexion": 130,
            "thigh.abduction": 5,
            "shank.flexion": 100,
            "spine.flexion": 20,
            "chest.flexion": 20,
        }
    ),
}
_LEG_SPEED_RADPS = 3.0
_VISIT_S = 1.3
_FINGERS_M = 0.04  # from the point of the palm towards the finger tips
_DEPTH_M = 0.01  # by which the target is beyond the middle of the region


@register_expert("SelfTouch")
class SelfTouchExpert(Expert[SelfTouch]):
    """Moves both hands from region to region by inverse kinematics; draws up the legs for them.

    After a round it visits the regions that are still missing again. Reads the poses of its own
    bones and which regions have been touched from the simulator (privileged).
    """

    reads = ()

    def __init__(self, task: SelfTouch, player: Player) -> None:
        super().__init__(task, player)
        self._arms = ArmKinematics(task.body)
        self._step_s = task.world.clock.step_s
        self._legs = KeyPoses(task.body, _LEGS, self._step_s)
        bones = task.body.skeleton.bones
        self._centres = {b.name: np.array(b.colliders[0].pose.position) for b in bones}

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._legs.reset()
        self._targets = self.task.body.joint_angles()
        self._visit, self._left_s = 0, _VISIT_S

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        self._left_s -= self._step_s
        if self._left_s < 0.0 or self._is_done():
            self._next()
        *regions, legs = _VISITS[self._visit]
        targets = self._legs.toward(legs, _LEG_SPEED_RADPS)
        self._targets = self._arms.reach(self._targets, self._goals(regions), iterations=2)
        arms = self._arms.joints
        targets[arms] = self._targets[arms]
        return targets

    def _is_done(self) -> bool:
        """Return whether both regions of the present visit have been touched."""
        regions = zip(_VISITS[self._visit][:2], self.task.touched.values(), strict=True)
        return all(region in touched for region, touched in regions)

    def _next(self) -> None:
        """Go on to the next visit with a region that is missing; the next one if there is none."""
        self._left_s = _VISIT_S
        for _ in _VISITS:
            self._visit = (self._visit + 1) % len(_VISITS)
            if not self._is_done():
                return

    def _goals(self, regions: list[str]) -> Palms:
        """Return palms that press on the middle of a region each, the fingers as they are.

        The neck is between chin and chest: the fingers point at it.
        """
        palms = self._arms.palms()
        points = np.array([self._middle(region) for region in regions])
        away = points - palms.points
        toward = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-6)
        neck = np.array([[region == "neck"] for region in regions])
        depth = np.where(neck, -_FINGERS_M, _DEPTH_M)
        return Palms(
            points + depth * toward,
            np.where(neck, palms.normals, toward),
            np.where(neck, toward, palms.fingers),
        )

    def _middle(self, region: str) -> Floats:
        pose = self.task.body.bone(region)
        middle: Floats = pose.position + pose.rotation @ self._centres[region]
        return middle
