"""Changes of posture by key poses: turning over, and getting up onto hands and knees."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.body.humanoid.postures import ON_BACK, Posture
from veca_marl.sim.geometry import Floats


class KeyPoses:
    """Target angles that move to a key pose at a limited speed.

    Args:
        body: The body.
        poses: Key poses by name; only their joint angles are used.
        step_s: Duration of an environment step.

    Attributes:
        targets: The target angles of the last step, ``(82,)`` rad.
    """

    def __init__(self, body: Humanoid, poses: Mapping[str, Posture], step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._poses = {name: body.posture_angles(pose) for name, pose in poses.items()}
        self.reset()

    def reset(self, targets: Floats | None = None) -> None:
        """Start from target angles, ``(82,)`` rad; None are the present joint angles."""
        self.targets = self._body.joint_angles() if targets is None else targets.copy()

    def toward(self, name: str, speed_radps: float) -> Floats:
        """Return the target angles of the next step, ``(82,)`` rad.

        Args:
            name: Name of the key pose.
            speed_radps: Speed of each target angle.
        """
        limit_rad = speed_radps * self._step_s
        change = self._poses[name] - self.targets
        self.targets = self.targets + np.clip(change, -limit_rad, limit_rad)
        return self.targets.copy()

    def error_rad(self, name: str) -> float:
        """Return how far the body is from a key pose: the root mean square of the angles."""
        errors = self._poses[name] - self._body.joint_angles()
        return float(np.sqrt((errors**2).mean()))


# set by hand, then improved by a random search for the return of TurnBaby, with torque control
# and with position control
_TURNING_POSES = {
    # legs raised and crossed, trunk bent: the centre of mass moves over the left side
    "swing": Posture(
        joints_deg={
            "l_upper_arm.flexion": 170,
            "l_upper_arm.abduction": -10,
            "r_upper_arm.flexion": 65,
            "r_upper_arm.abduction": -10,
            "r_forearm.flexion": 25,
            "r_thigh.flexion": 20,
            "r_thigh.abduction": -25,
            "r_shank.flexion": 55,
            "l_thigh.flexion": 85,
            "l_thigh.abduction": -25,
            "spine.rotation": 10,
            "chest.flexion": 30,
            "spine.flexion": -5,
            "chest.lateral": -20,
            "neck.rotation": -55,
            "neck.flexion": 45,
        }
    ),
    # on the side: extend, and reach across with the right arm
    "over": Posture(
        joints_deg={
            "l_upper_arm.flexion": 140,
            "l_upper_arm.abduction": 50,
            "l_forearm.flexion": 5,
            "r_upper_arm.flexion": 100,
            "r_upper_arm.abduction": -40,
            "r_forearm.flexion": 65,
            "r_thigh.flexion": 25,
            "r_thigh.abduction": -25,
            "l_thigh.flexion": -10,
            "l_thigh.abduction": 55,
            "chest.rotation": 10,
            "spine.rotation": 10,
            "chest.flexion": -10,
            "spine.flexion": -15,
            "chest.lateral": 20,
            "neck.rotation": 25,
            "neck.flexion": 15,
        }
    ),
    # on the belly, arms and legs extended
    "lie": Posture(
        joints_deg={
            "upper_arm.flexion": 160,
            "upper_arm.abduction": 20,
            "forearm.flexion": 20,
            "neck.flexion": -20,
            "head.flexion": -20,
            "foot.dorsiflexion": -50,
        }
    ),
    "rest": ON_BACK,
}
_TURNING_RADPS = 12.0
# cosines of the angle between the front of the trunk and straight down
_ON_SIDE, _NEARLY_OVER, _FALLEN_BACK = -0.2, 0.55, -0.5
_SWING_S, _REST_S = 2.0, 0.5  # longest swing, rest after it


_MIDLINE_BONES = ("spine", "chest", "neck", "head")
_MIDLINE = ("lateral", "rotation")  # joints of the trunk with opposite angles in a mirror image


def mirrored(posture: Posture) -> Posture:
    """Return the mirror image of a posture."""
    return Posture(posture.pitch_deg, dict(map(_mirrored, posture.joints_deg.items())))


def _mirrored(joint: tuple[str, float]) -> tuple[str, float]:
    name, angle = joint
    if name.startswith(("l_", "r_")):
        return ("r_" if name.startswith("l_") else "l_") + name[2:], angle
    bone, _, label = name.partition(".")
    return name, -angle if bone in _MIDLINE_BONES and label in _MIDLINE else angle


_MIRRORED = {name: mirrored(posture) for name, posture in _TURNING_POSES.items()}


class TurnOver:
    """Target angles of a body that turns over; it starts again after falling back.

    The first attempt is over the left side. After a swing that did not turn the body the next one
    is over the other side: the same swing from the same place would fail again.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._sides = [KeyPoses(body, _TURNING_POSES, step_s), KeyPoses(body, _MIRRORED, step_s)]
        self.reset()

    def reset(self) -> None:
        """Start with a swing."""
        self._start(0)
        self._pose, self._elapsed_s = "swing", 0.0

    def command(self) -> Floats:
        """Return the target angles of the next step, ``(82,)`` rad."""
        chosen = self._choose()
        if self._pose == "rest" and chosen == "swing":
            self._start(1 - self._side)
        self._elapsed_s = self._elapsed_s + self._step_s if chosen == self._pose else 0.0
        self._pose = chosen
        return self._sides[self._side].toward(chosen, _TURNING_RADPS)

    def follow_body(self) -> None:
        """See `Expert.follow_body`; the pose depends on the directions of chest and pelvis."""

    def _start(self, side: int) -> None:
        """Move over a side from the present joint angles: 0 is the left one, 1 the right one."""
        self._side = side
        self._sides[side].reset()

    def _choose(self) -> str:
        """Return the name of the key pose to move to."""
        down = -self._body.bone("chest").forward[2] - self._body.bone("pelvis").forward[2]
        down, late = down / 2.0, self._elapsed_s > _SWING_S
        if self._pose == "swing":
            return "over" if down > _ON_SIDE else "rest" if late else "swing"
        if self._pose == "rest":
            return "swing" if self._elapsed_s > _REST_S else "rest"
        if down < _FALLEN_BACK:
            return "swing"
        return "lie" if down > _NEARLY_OVER else self._pose


# set by hand, then improved by a random search for the return of SitBaby
_RISING_POSES = {
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
_RISING_RADPS = 10.0
_DURATION_S = {"lie": 0.4, "prepare": 0.5, "push": 1.1}
_NEXT_STAGE = {"lie": "prepare", "prepare": "push"}
# for `follow_body`: a pose counts as out of reach after so many times the duration of its stage
_PATIENCE = 2.0
# Root mean square of the angles within which a pose is reached. The expert is 0.43 to 0.47 away
# when it begins to move there, and 0.04 to 0.07 at the end. With 0.15 a policy of DAgger came to
# rest outside, where two labels alternated; with 0.25 a body that executes the labels tips over.
_AT_POSE_RAD = 0.2
_UNPREPARED_RAD = 0.35  # beyond it a body is no longer prepared to push
_RAISED_M = 0.155  # height of the top of the chest on extended arms; the end of pushing is at 0.18
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
        self._key_poses = KeyPoses(body, _RISING_POSES, step_s)
        self._waited_s = 0.0  # since the stage began, while others act
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

    def follow_body(self) -> None:
        """Return to the stage at which the body is; see `Expert.follow_body`.

        A body that is not on its belly turns over. A stage ends when its pose is reached. Preparing
        also ends after twice its duration, since a limb may be caught below the body. After as many
        durations of pushing, a body that has left the prepared pose prepares again.
        """
        if self._stage == "lie":
            return
        if not self._is_on_belly():
            self.reset()
            return
        self._waited_s += self._step_s
        is_late = self._waited_s > _PATIENCE * _DURATION_S[self._stage]
        if self._has_reached_pose() or (is_late and self._stage == "prepare"):
            self._elapsed_s = _DURATION_S[self._stage]
        elif is_late and self._key_poses.error_rad("prepare") > _UNPREPARED_RAD:
            self._begin("prepare")
        else:
            self._elapsed_s = 0.0

    def _has_reached_pose(self) -> bool:
        is_raised = self._stage != "push" or self._body.bone("neck").position[2] > _RAISED_M
        return bool(is_raised) and self._key_poses.error_rad(self._stage) < _AT_POSE_RAD

    def _is_on_belly(self) -> bool:
        return bool(self._body.bone("chest").forward[2] < -_ON_BELLY)

    def _targets(self) -> Floats:
        if self._stage != "lie":
            return self._key_poses.toward(self._stage, _RISING_RADPS)
        if not self._is_on_belly():
            self._elapsed_s = 0.0
        return self._turn.command()

    def _end_stage(self) -> None:
        if self._stage in _NEXT_STAGE:
            self._begin(_NEXT_STAGE[self._stage])
        else:
            self.is_complete = True

    def _begin(self, stage: str) -> None:
        self._stage, self._elapsed_s, self._waited_s = stage, 0.0, 0.0
        if stage == "prepare":
            self._key_poses.reset()


# vertical component of the front of the chest: -1 on the belly, 1 on the back; at most -0.6 in 20 s
# of crawling, pushing and dribbling
_FALLEN = -0.3
_FALLEN_S = 0.4  # a body that rolls over by itself has not fallen


class FallRecovery:
    """Notices that a body lies on its back or on a side, and gets it up onto hands and knees.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._get_up = GetUp(body, step_s)
        self._fallen_s, self._is_rising = 0.0, False

    def command(self) -> JointCommand | None:
        """Return the target angles of the next step; None for a body that has not fallen.

        Call it once per step.
        """
        if not self._is_rising and self._has_fallen():
            self._is_rising = True
            self._get_up.reset()
        if not self._is_rising:
            return None
        command = self._get_up.command()
        self._is_rising = not self._get_up.is_complete
        return command

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        if self._is_rising:
            self._get_up.follow_body()

    def _has_fallen(self) -> bool:
        is_down = self._body.bone("chest").forward[2] > _FALLEN
        self._fallen_s = self._fallen_s + self._step_s if is_down else 0.0
        return self._fallen_s >= _FALLEN_S
