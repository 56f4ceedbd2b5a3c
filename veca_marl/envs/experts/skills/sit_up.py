"""Sitting up from the back: turn to the belly, push up on the hands, sit back on the heels.

A random search found no sit-up straight from the back, since trunk and head outweigh the legs.
"""

from __future__ import annotations

from veca_marl.envs.experts.control.key_poses import KeyPoses
from veca_marl.envs.experts.skills.turn_over import TurnOver
from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.body.humanoid.postures import Posture

# set by hand, then improved by a random search, as those of `turn_over`
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
    # hips on the heels, supported by straight arms, head up
    "sit": Posture(
        joints_deg={
            "upper_arm.flexion": 52,
            "upper_arm.internal_rotation": 11,
            "hand.flexion": -52,
            "thigh.flexion": 107,
            "thigh.abduction": 20,
            "thigh.internal_rotation": -7,
            "shank.flexion": 148,
            "chest.flexion": -10,
            "neck.flexion": -38,
            "head.flexion": -23,
            "foot.dorsiflexion": -52,
        }
    ),
}
_SPEEDS_RADPS = {"prepare": 10.0, "push": 10.0, "sit": 4.0}
_DURATION_S = {"lie": 0.4, "prepare": 0.5, "push": 1.1, "sit": 2.0}
_NEXT_STAGE = {"lie": "prepare", "prepare": "push", "push": "sit"}
_ON_BELLY = 0.7  # cosine of the angle between the front of the chest and straight down
_FAILED_M = 0.24  # below this height of the top of the chest the attempt has failed


class SitUp:
    """Target angles of a body that sits up, in stages; it starts again after a failed attempt.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._turn = TurnOver(body, step_s)
        self._key_poses = KeyPoses(body, _POSES, step_s)
        self._stage, self._elapsed_s = "lie", 0.0
        self.reset()

    def reset(self) -> None:
        """Start with turning over."""
        self._begin("lie")
        self._turn.reset()

    def command(self) -> JointCommand:
        """Return the target angles of the next step."""
        self._elapsed_s += self._step_s
        if self._stage == "lie":
            if not self._body.bone("chest").forward[2] < -_ON_BELLY:
                self._elapsed_s = 0.0
            targets = self._turn.command()
        else:
            targets = self._key_poses.toward(self._stage, _SPEEDS_RADPS[self._stage])
        self._advance_stage()
        return JointCommand(targets, horizon_s=0.0)

    def _advance_stage(self) -> None:
        late = self._elapsed_s >= _DURATION_S[self._stage]
        if late and self._stage in _NEXT_STAGE:
            self._begin(_NEXT_STAGE[self._stage])
        elif late and self._body.bone("neck").position[2] < _FAILED_M:
            self.reset()

    def _begin(self, stage: str) -> None:
        self._stage, self._elapsed_s = stage, 0.0
        if stage == "prepare":
            self._key_poses.reset()
