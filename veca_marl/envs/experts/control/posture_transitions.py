"""Turning from the back to the belly over the left side, then over the right one."""

from __future__ import annotations

from veca_marl.envs.experts.control.key_poses import KeyPoses
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import ON_BACK, Posture
from veca_marl.sim.geometry import Floats

# set by hand, then improved by a random search for the return of TurnBaby, with torque control
# and with position control
_POSES = {
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
_SPEED_RADPS = 12.0
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


_MIRRORED = {name: mirrored(posture) for name, posture in _POSES.items()}


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
        self._sides = [KeyPoses(body, _POSES, step_s), KeyPoses(body, _MIRRORED, step_s)]
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
        return self._sides[self._side].toward(chosen, _SPEED_RADPS)

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
