"""Running: a periodic gait with feedback from the inclination of the chest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.geometry import Floats

_ELBOW_DEG = 30.0


@dataclass(frozen=True)
class RunningPattern:
    """Parameters of the gait: angles in degrees, gains in degrees per radian of inclination.

    Inclination is the horizontal part of the chest's up axis, forwards or to the left. The values
    were set by hand and then improved by random searches for the distance that the pelvis
    covers before a fall.
    """

    frequency_hz: float = 2.18
    hip: float = -1.59
    hip_swing: float = -0.32
    hip_lift: float = 10.33
    knee: float = 9.75
    knee_lift: float = 11.55
    lift_lead_rad: float = 0.6
    foot: float = 26.4
    foot_swing: float = 17.82
    abduction: float = 12.12
    sway: float = 1.17
    sway_lead_rad: float = -0.31
    spine: float = -14.51
    arm: float = -0.87
    arm_swing: float = 20.35
    arm_abduction: float = -58.87
    hip_gain: float = 22.95
    hip_rate_gain: float = -4.18
    foot_gain: float = -32.23
    abduction_gain: float = -1.71
    abduction_rate_gain: float = 3.33


class Running:
    """Target angles that imitate running; the body falls forwards after about one second.

    The stance leg turns the trunk upright, the swing leg moves in the direction of the fall. Feet
    are lifted too little and too late to catch the fall.

    Args:
        body: The body.
        step_s: Duration of an environment step.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s, self._pattern = body, step_s, RunningPattern()
        self._index = {name: index for index, name in enumerate(body.joint_names)}
        self.reset()

    def reset(self) -> None:
        """Start with the left leg and the trunk upright."""
        self._time_s, self._inclination = 0.0, np.zeros(2)

    def command(self) -> JointCommand:
        """Return the target angles of the next step."""
        inclination = self._chest_inclination()
        rate = (inclination - self._inclination) / self._step_s
        phase = 2.0 * math.pi * self._pattern.frequency_hz * self._time_s
        self._inclination, self._time_s = inclination, self._time_s + self._step_s
        degrees = np.zeros(len(self._index))
        degrees[self._index["spine.flexion"]] = self._pattern.spine
        sway = self._pattern.sway * math.sin(phase + self._pattern.sway_lead_rad)
        for side, shift, left in (("l_", 0.0, 1.0), ("r_", math.pi, -1.0)):
            lift = max(0.0, math.cos(phase + shift + self._pattern.lift_lead_rad))
            limbs = self._leg(phase + shift, lift, inclination[0], rate[0])
            limbs |= self._arm(phase + shift)
            limbs["thigh.abduction"] = left * sway + self._abduction(
                lift, left * inclination[1], left * rate[1]
            )
            for name, angle in limbs.items():
                degrees[self._index[side + name]] = angle
        return JointCommand(np.radians(degrees), self._step_s)

    def _chest_inclination(self) -> Floats:
        """Return the inclination of the chest forwards and to the left, ``(2,)``."""
        up, forward = self._body.bone("chest").up, self._body.forward
        return np.array([up @ forward, up[1] * forward[0] - up[0] * forward[1]])

    def _leg(self, phase: float, lift: float, inclination: float, rate: float) -> dict[str, float]:
        """Return the angles of a leg in degrees, except for the abduction of the thigh."""
        p = self._pattern
        correction = p.hip_gain * inclination + p.hip_rate_gain * rate
        swinging = lift > 0.0
        hip = p.hip + p.hip_swing * math.sin(phase) + p.hip_lift * lift
        foot = p.foot + p.foot_swing * math.sin(phase)
        return {
            "thigh.flexion": hip + (correction if swinging else -correction),
            "shank.flexion": p.knee + p.knee_lift * lift,
            "foot.dorsiflexion": foot - (0.0 if swinging else p.foot_gain * inclination),
        }

    def _arm(self, phase: float) -> dict[str, float]:
        """Return the angles of an arm in degrees."""
        p = self._pattern
        return {
            "upper_arm.flexion": p.arm - p.arm_swing * math.sin(phase),
            "upper_arm.abduction": p.arm_abduction,
            "forearm.flexion": _ELBOW_DEG,
        }

    def _abduction(self, lift: float, inclination: float, rate: float) -> float:
        """Return the lateral correction of a hip in degrees; positive is to the leg's own side."""
        p = self._pattern
        correction = p.abduction_gain * inclination + p.abduction_rate_gain * rate
        return p.abduction + (correction if lift > 0.0 else -correction)
