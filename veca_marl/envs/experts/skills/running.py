"""Running as far as it goes: stepping into the fall, the trunk held up by hips and ankles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.joint_controls import Springs
from veca_marl.sim.geometry.pose import Floats


@dataclass(frozen=True)
class Stride:
    """Numbers of the stride: angles in degrees, gains in degrees for a lean of one radian.

    A lean is the horizontal part of the chest's up axis, forward or to the left. Drawn by hand,
    then improved by a random search for the way covered before a fall.
    """

    frequency_hz: float = 1.88
    hip: float = -3.4
    hip_swing: float = 2.7
    hip_lift: float = 20.0
    knee: float = 18.6
    knee_lift: float = 32.2
    lift_lead_rad: float = 0.34
    foot: float = 25.9
    foot_swing: float = 19.1
    abduction: float = 11.6
    sway: float = -0.8
    sway_lead_rad: float = -0.66
    spine: float = -8.9
    arm: float = -2.9
    arm_swing: float = 9.6
    arm_abduction: float = -39.0
    hip_gain: float = 24.1
    hip_rate_gain: float = -0.7
    foot_gain: float = -37.0
    abduction_gain: float = 4.2
    abduction_rate_gain: float = 4.1


class Running:
    """A rhythm in time, corrected by how the chest leans.

    Args:
        body: Who runs.
        step_s: Time between two wishes.
    """

    def __init__(self, body: Humanoid, step_s: float) -> None:
        self._body, self._step_s, self._stride = body, step_s, Stride()
        self._joint = {name: index for index, name in enumerate(body.joint_names)}
        self.reset()

    def reset(self) -> None:
        """Begin with the left leg, upright."""
        self._time_s, self._lean = 0.0, np.zeros(2)

    def command(self) -> Springs:
        """Return where springs shall pull the joints now."""
        lean = self._leans()
        rate = (lean - self._lean) / self._step_s
        phase = 2.0 * math.pi * self._stride.frequency_hz * self._time_s
        self._lean, self._time_s = lean, self._time_s + self._step_s
        degrees = np.zeros(len(self._joint))
        degrees[self._joint["spine.flexion"]] = self._stride.spine
        sway = self._stride.sway * math.sin(phase + self._stride.sway_lead_rad)
        for side, shift, left in (("l_", 0.0, 1.0), ("r_", math.pi, -1.0)):
            lift = max(0.0, math.cos(phase + shift + self._stride.lift_lead_rad))
            limbs = self._leg(phase + shift, lift, lean[0], rate[0])
            limbs |= self._arm(phase + shift)
            limbs["thigh.abduction"] = left * sway + self._aside(
                lift, left * lean[1], left * rate[1]
            )
            for name, angle in limbs.items():
                degrees[self._joint[side + name]] = angle
        return Springs(np.radians(degrees), ahead_s=0.0)

    def _leans(self) -> Floats:
        up, forward = self._body.bone("chest").up, self._body.forward
        return np.array([up @ forward, up[1] * forward[0] - up[0] * forward[1]])

    def _leg(self, phase: float, lift: float, lean: float, rate: float) -> dict[str, float]:
        """The swinging leg steps further into the fall, the standing one holds the trunk up."""
        s = self._stride
        correction = s.hip_gain * lean + s.hip_rate_gain * rate
        swinging = lift > 0.0
        hip = s.hip + s.hip_swing * math.sin(phase) + s.hip_lift * lift
        foot = s.foot + s.foot_swing * math.sin(phase)
        return {
            "thigh.flexion": hip + (correction if swinging else -correction),
            "shank.flexion": s.knee + s.knee_lift * lift,
            "foot.dorsiflexion": foot - (0.0 if swinging else s.foot_gain * lean),
        }

    def _arm(self, phase: float) -> dict[str, float]:
        s = self._stride
        return {
            "upper_arm.flexion": s.arm - s.arm_swing * math.sin(phase),
            "upper_arm.abduction": s.arm_abduction,
            "forearm.flexion": 30.0,
        }

    def _aside(self, lift: float, lean: float, rate: float) -> float:
        """Step aside into a fall to the leg's side, and push the trunk back with the other."""
        correction = self._stride.abduction_gain * lean + self._stride.abduction_rate_gain * rate
        return self._stride.abduction + (correction if lift > 0.0 else -correction)
