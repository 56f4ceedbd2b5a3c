"""Sitting up from the back: turn to the belly, push up on the hands, sit back on the heels, rise.

A random search found no sit-up straight from the back, since trunk and head outweigh the legs.
"""

from __future__ import annotations

import math

from veca_marl.envs.experts.control.key_poses import KeyPoses
from veca_marl.envs.experts.control.seated_balance import SeatedBalance
from veca_marl.envs.experts.skills.turn_over import TurnOver
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
# set by hand; those up to "push" then improved by a random search, as those of `turn_over`
_POSES = {
    # on the belly: hands beside the shoulders, knees bent
    "prepare": Posture(
        joints_deg={
            "upper_arm.flexion": 70,
            "upper_arm.abduction": 33,
            "upper_arm.internal_rotation": -6,
            "forearm.flexion": 126,
            "thigh.flexion": -7,
            "thigh.abduction": 20,
            "shank.flexion": 88,
            "spine.flexion": 12,
            "neck.flexion": -40,
            "foot.dorsiflexion": -44,
        }
    ),
    # arms extended, knees under the hips
    "push": Posture(
        joints_deg={
            "upper_arm.flexion": 79,
            "upper_arm.abduction": 20,
            "upper_arm.internal_rotation": 3,
            "forearm.flexion": 38,
            "hand.flexion": -44,
            "thigh.flexion": 102,
            "thigh.abduction": 40,
            "shank.flexion": 131,
            "spine.flexion": -15,
            "neck.flexion": -44,
            "foot.dorsiflexion": -43,
        }
    ),
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
_SPEEDS_RADPS = {"prepare": 10.0, "push": 10.0, "sit": 4.0}
_DURATION_S = {"lie": 0.4, "prepare": 0.5, "push": 1.1, "sit": 1.0, "rise": 1.5}
_NEXT_STAGE = {"lie": "prepare", "prepare": "push", "push": "sit", "sit": "rise"}
_ON_BELLY = 0.7  # cosine of the angle between the front of the chest and straight down
_FAILED_M = 0.12  # below this height of the top of the chest the attempt has failed
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
        self._turn = TurnOver(body, step_s)
        self._key_poses = KeyPoses(body, _POSES, step_s)
        self._balance = SeatedBalance(body, _POSES["rise"], _POSES["sit"], integral_gain=0.0)
        self._stage, self._elapsed_s, self._bend = "lie", 0.0, _BENT_AT_FIRST
        self.reset()

    def reset(self) -> None:
        """Start with turning over."""
        self._begin("lie")
        self._turn.reset()

    def command(self) -> JointCommand:
        """Return the target angles of the next step."""
        self._elapsed_s += self._step_s
        command = self._stage_command()
        self._advance_stage()
        return command

    def _stage_command(self) -> JointCommand:
        if self._stage == "rise":
            return JointCommand(self._rising(), self._step_s)
        if self._stage == "lie":
            if not self._body.bone("chest").forward[2] < -_ON_BELLY:
                self._elapsed_s = 0.0
            return JointCommand(self._turn.command(), _HORIZON * self._step_s)
        targets = self._key_poses.toward(self._stage, _SPEEDS_RADPS[self._stage])
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
        late = self._elapsed_s >= _DURATION_S[self._stage]
        if late and self._stage in _NEXT_STAGE:
            self._begin(_NEXT_STAGE[self._stage])
        elif late and self._body.bone("neck").position[2] < _FAILED_M:
            self.reset()

    def _begin(self, stage: str) -> None:
        self._stage, self._elapsed_s = stage, 0.0
        self._bend = _BENT_AT_FIRST
        if stage == "prepare":
            self._key_poses.reset()
