"""How the walking body moves its bones: joint angles from the phase of the stride, a kick, a gaze.

The gait is kinematic: sinusoids with the phase relations of human walking (legs in antiphase, arms
against legs, the knee bent in swing), not a simulation of forces. Amplitudes are ours, chosen by
eye within the ranges of motion of the skeleton.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.pose import Floats
from veca_marl.sim.skeleton import Skeleton


@dataclass(frozen=True)
class GaitCfg:
    """Numbers of the gait.

    Attributes:
        hip_swing_rad: Amplitude of the thigh at full stride.
        knee_bend_rad: Greatest extra knee flexion, in mid swing.
        arm_swing_rad: Amplitude of the upper arm at full stride.
        full_stride_mps: Speed from which the stride no longer lengthens, only quickens.
        stride_m: Distance of two steps at full stride; about 4 x leg length x sin(hip swing).
        kick_s: Duration of a kick.
    """

    hip_swing_rad: float = 0.42
    knee_bend_rad: float = 0.9
    arm_swing_rad: float = 0.45
    full_stride_mps: float = 0.6
    stride_m: float = 0.48
    kick_s: float = 0.36


class Gait:
    """Turns speed and time into the 82 joint angles of a walking child."""

    def __init__(self, skeleton: Skeleton, cfg: GaitCfg | None = None) -> None:
        self.cfg = cfg or GaitCfg()
        joint = skeleton.joint
        self._thigh = (joint("l_thigh", "flexion"), joint("r_thigh", "flexion"))
        self._shank = (joint("l_shank", "flexion"), joint("r_shank", "flexion"))
        self._foot = (joint("l_foot", "dorsiflexion"), joint("r_foot", "dorsiflexion"))
        self._arm = (joint("l_upper_arm", "flexion"), joint("r_upper_arm", "flexion"))
        self._elbow = (joint("l_forearm", "flexion"), joint("r_forearm", "flexion"))
        self._nod = (joint("neck", "flexion"), joint("head", "flexion"))
        self._shake = (joint("neck", "rotation"), joint("head", "rotation"))
        self._low = np.array([j.low_rad for j in skeleton.joints])
        self._high = np.array([j.high_rad for j in skeleton.joints])
        self.angles: Floats = np.zeros(len(skeleton.joints))
        self.phase_rad = 0.0
        self._kick_left_s = 0.0
        self._pace_mps = 0.0

    @property
    def pitch_range_rad(self) -> tuple[float, float]:
        """Least and greatest head pitch (down is positive): neck and head together."""
        low, high = self._low[list(self._nod)].sum(), self._high[list(self._nod)].sum()
        return float(low), float(high)

    @property
    def yaw_range_rad(self) -> tuple[float, float]:
        """Least and greatest head yaw (left is positive): neck and head together."""
        low, high = self._low[list(self._shake)].sum(), self._high[list(self._shake)].sum()
        return float(low), float(high)

    def reset(self) -> None:
        """Stand still."""
        self.phase_rad = 0.0
        self._kick_left_s = 0.0

    def kick(self) -> None:
        """Begin a kick with the right leg."""
        self._kick_left_s = self.cfg.kick_s

    def advance(self, speed_mps: float, turn_radps: float, step_s: float) -> None:
        """Move the phase on; turning on the spot steps as well.

        Args:
            speed_mps: Forward speed, negative when walking backward.
            turn_radps: Turning speed.
            step_s: Time step.
        """
        pace = speed_mps + math.copysign(0.1 * abs(turn_radps), speed_mps or 1.0)
        stride = self.cfg.stride_m * max(self._stride_share(pace), 0.35)
        self.phase_rad = (self.phase_rad + 2.0 * math.pi * pace * step_s / stride) % (2.0 * math.pi)
        self._kick_left_s = max(0.0, self._kick_left_s - step_s)
        self._pace_mps = pace

    def pose(self, head_pitch_rad: float, head_yaw_rad: float) -> Floats:
        """Write and return the ``(82,)`` joint angles for this moment."""
        share = self._stride_share(self._pace_mps) if self.phase_rad else 0.0
        for side in (0, 1):
            self._swing_leg(side, share)
        self._swing_kicking_leg()
        for nod, shake in zip(self._nod, self._shake, strict=True):
            self.angles[nod] = head_pitch_rad / 2.0
            self.angles[shake] = head_yaw_rad / 2.0
        np.clip(self.angles, self._low, self._high, out=self.angles)
        return self.angles

    def _stride_share(self, pace_mps: float) -> float:
        return min(1.0, abs(pace_mps) / self.cfg.full_stride_mps)

    def _swing_leg(self, side: int, share: float) -> None:
        phase = self.phase_rad + math.pi * side
        swing, lift = math.sin(phase), max(0.0, math.cos(phase))
        thigh = self.cfg.hip_swing_rad * share * swing
        knee = self.cfg.knee_bend_rad * share * lift + 0.05
        self.angles[self._thigh[side]] = thigh + 0.3 * knee
        self.angles[self._shank[side]] = knee
        self.angles[self._foot[side]] = 0.7 * knee - thigh if lift == 0.0 else 0.3 * knee
        self.angles[self._arm[side]] = -self.cfg.arm_swing_rad * share * swing
        self.angles[self._elbow[side]] = 0.35

    def _swing_kicking_leg(self) -> None:
        if self._kick_left_s <= 0.0:
            return
        progress = 1.0 - self._kick_left_s / self.cfg.kick_s
        self.angles[self._thigh[1]] = 1.1 * math.sin(2.0 * math.pi * (progress - 0.25))
        self.angles[self._shank[1]] = 0.9 * max(0.0, math.cos(2.0 * math.pi * progress))
        self.angles[self._foot[1]] = -0.4
