"""Sitting up from the back: turn to the belly, push up on the hands, sit back on the heels, rise.

A random search found no sit-up straight from the back, since trunk and head outweigh the legs.
"""

from __future__ import annotations

import math

from veca_marl.envs.experts.control.posture_transitions import GetUp, KeyPoses
from veca_marl.envs.experts.control.seated_balance import SeatedBalance
from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats

_KNEELING = {
    "thigh.abduction": 20,
    "thigh.internal_rotation": -7,
    "shank.flexion": 148,
    "foot.dorsiflexion": -52,
    "upper_arm.internal_rotation": 11,
}
# set by hand
_POSES = {
    # hips on the heels, trunk bent forwards by 50 degrees, supported by straight arms
    "sit": Posture(
        joints_deg={
            **_KNEELING,
            "thigh.flexion": 120,
            "spine.flexion": -15,
            "chest.flexion": -10,
            "neck.flexion": -38,
            "head.flexion": -20,
            "upper_arm.flexion": 52,
            "hand.flexion": -52,
        }
    ),
    # the trunk upright on the heels, the arms hanging forwards
    "rise": Posture(
        joints_deg={
            **_KNEELING,
            "thigh.flexion": 108,
            "spine.flexion": -10,
            "chest.flexion": -8,
            "neck.flexion": -20,
            "upper_arm.flexion": 45,
            "forearm.flexion": 15,
        }
    ),
}
_SIT_RADPS = 4.0
_SIT_S, _RISE_S = 1.0, 1.5
_FAILED_M = 0.12  # below this height of the top of the chest the attempt has failed
_ON_HANDS_M = 0.14  # below it the body is no longer on hands and knees, where it is at 0.15 to 0.19
_AT_POSE_RAD = 0.15  # the expert is within 0.07 at the end; with 0.2 the body stays lower
_HORIZON = 0.5  # before rising: prediction of the joint angles in agent steps; 1 damps more
_BENT_AT_FIRST, _RISING_S = 0.8, 0.5  # share of the bend at the start; time from bent to upright
_ON_HEELS_RAD = math.radians(45.0)  # from the vertical; a thigh that is steeper has left the heel


class SitUp:
    """Target angles of a body that sits up, in stages; it starts again after a failed attempt.

    While it rises, trunk and hips move to the upright posture as long as the thighs are on the
    heels, else back to the bent one: the extension of the hips then lifts the pelvis instead of the
    trunk. `SeatedBalance` holds the trunk against its weight; without it the upright trunk leans
    forward within two seconds and begins to rise again, or falls onto its back.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._get_up = GetUp(body, step_s)
        self._key_poses = KeyPoses(body, _POSES, step_s)
        self._balance = SeatedBalance(body, step_s, _POSES["rise"], _POSES["sit"], 0.0)
        self._stage, self._elapsed_s, self._bend = "get up", 0.0, _BENT_AT_FIRST
        self.reset()

    def reset(self) -> None:
        """Start with getting up onto hands and knees."""
        self._get_up.reset()
        self._begin("get up")

    def command(self) -> JointCommand:
        """Return the target angles of the next step."""
        self._elapsed_s += self._step_s
        command = self._stage_command()
        self._advance_stage()
        return command

    def follow_body(self) -> None:
        """Return to the stage at which the body is; see `Expert.follow_body`.

        A body that has fallen gets up at once, and sitting back ends when its pose is reached.
        """
        if self._stage == "get up":
            self._get_up.follow_body()
        elif self._is_below(_ON_HANDS_M):
            self.reset()
        elif self._stage == "sit":
            is_sitting = self._key_poses.error_rad("sit") < _AT_POSE_RAD
            self._elapsed_s = _SIT_S if is_sitting else 0.0

    def _stage_command(self) -> JointCommand:
        if self._stage == "get up":
            return self._get_up.command()
        if self._stage == "rise":
            return JointCommand(self._rising(), self._step_s)
        targets = self._key_poses.toward("sit", _SIT_RADPS)
        return JointCommand(targets, _HORIZON * self._step_s)

    def _rising(self) -> Floats:
        """Return target angles between the bent posture and the upright one, ``(82,)`` rad."""
        change = self._step_s / _RISING_S
        bend = self._bend - change if self._is_on_heels() else self._bend + change
        self._bend = min(max(bend, 0.0), 1.0)
        return self._balance.hold(self._balance.upright, self._bend)

    def _is_on_heels(self) -> bool:
        """Return whether the left thigh is near the horizontal, its knee in front of the hip."""
        way = self._body.bone("l_shank").position - self._body.bone("l_thigh").position
        return math.atan2(way @ self._body.forward, -way[2]) > _ON_HEELS_RAD

    def _advance_stage(self) -> None:
        if self._stage == "get up" and self._get_up.is_complete:
            self._key_poses.reset(self._get_up.targets)
            self._begin("sit")
        elif self._stage == "sit" and self._elapsed_s >= _SIT_S:
            self._begin("rise")
        elif self._stage == "rise" and self._has_failed():
            self.reset()

    def _has_failed(self) -> bool:
        return self._elapsed_s >= _RISE_S and self._is_below(_FAILED_M)

    def _is_below(self, height_m: float) -> bool:
        return bool(self._body.bone("neck").position[2] < height_m)

    def _begin(self, stage: str) -> None:
        self._stage, self._elapsed_s, self._bend = stage, 0.0, _BENT_AT_FIRST
