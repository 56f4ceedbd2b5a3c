"""Getting up onto hands and knees from the back, a side or the belly."""

from __future__ import annotations

from veca_marl.envs.experts.control.key_poses import KeyPoses
from veca_marl.envs.experts.control.posture_transitions import TurnOver
from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats

# set by hand, then improved by a random search for the return of SitBaby
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
}
_SPEED_RADPS = 10.0
_DURATION_S = {"lie": 0.4, "prepare": 0.5, "push": 1.1}
_NEXT_STAGE = {"lie": "prepare", "prepare": "push"}
_ON_BELLY = 0.7  # cosine of the angle between the front of the chest and straight down
_HORIZON = 0.5  # prediction of the joint angles in agent steps; 1 damps more


class GetUp:
    """Target angles of a body that turns to its belly and pushes itself up, in stages.

    Attributes:
        is_complete: Whether all stages are over. The body is then on hands and knees, unless the
            attempt has failed.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._turn = TurnOver(body, step_s)
        self._key_poses = KeyPoses(body, _POSES, step_s)
        self.reset()

    def reset(self) -> None:
        """Start with turning over."""
        self._begin("lie")
        self._turn.reset()
        self.is_complete = False

    @property
    def targets(self) -> Floats:
        """``(82,)`` rad: the target angles of the last step of pushing up."""
        return self._key_poses.targets

    def command(self) -> JointCommand:
        """Return the target angles of the next step."""
        self._elapsed_s += self._step_s
        targets = self._targets()
        if self._elapsed_s >= _DURATION_S[self._stage]:
            self._end_stage()
        return JointCommand(targets, _HORIZON * self._step_s)

    def _targets(self) -> Floats:
        if self._stage != "lie":
            return self._key_poses.toward(self._stage, _SPEED_RADPS)
        if not self._body.bone("chest").forward[2] < -_ON_BELLY:
            self._elapsed_s = 0.0
        return self._turn.command()

    def _end_stage(self) -> None:
        if self._stage in _NEXT_STAGE:
            self._begin(_NEXT_STAGE[self._stage])
        else:
            self.is_complete = True

    def _begin(self, stage: str) -> None:
        self._stage, self._elapsed_s = stage, 0.0
        if stage == "prepare":
            self._key_poses.reset()
