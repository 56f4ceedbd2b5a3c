"""Crawling on hands and knees as an open-loop gait: knee and opposite hand move together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.geometry import Floats


@dataclass(frozen=True)
class JointSwing:
    """Motion of one joint of a limb during a stride, degrees.

    Attributes:
        middle: Mean angle.
        swing: Amplitude of the sine of the limb's phase.
        bend: Amplitude of an additional flexion while the limb moves forwards.
        sweep: Amplitude of an additional sine at full turn to the limb's own side.
    """

    middle: float
    swing: float = 0.0
    bend: float = 0.0
    sweep: float = 0.0


@dataclass(frozen=True)
class LimbPattern:
    """Motion of one limb during a stride.

    Attributes:
        joints: Motion of each joint, by its name without the side.
        lead_rad: Phase by which the limb leads the knee of its own side.
        shortening: Share by which its amplitude decreases at full turn to its own side.
    """

    joints: Mapping[str, JointSwing]
    lead_rad: float
    shortening: float


@dataclass(frozen=True)
class GaitPattern:
    """Parameters of a crawling gait.

    Attributes:
        frequency_hz: Strides per second.
        leg: The left leg; the right one is half a stride behind.
        arm: The left arm, likewise.
        bend_lead_rad: Phase by which limbs bend before they swing forwards.
        trunk: Constant angles of the trunk by joint, degrees.
        sway: Amplitudes of the trunk's joints over a stride, degrees.
        sway_lead_rad: Phase by which the sway leads the left knee.
        twist: Angles added to the trunk at full turn to the left, degrees.
        steering_s: Time constant of the low-pass filter of the turning command.
        full_turn_rad: Bearing at which the turning command saturates.
        thigh_lag_rad: Phase of the gait before that of the thighs, see `CrawlGait.followed_rad`.
            Mean over strides of a body that executes it (experiments/crawl/phase.py).
    """

    frequency_hz: float
    leg: LimbPattern
    arm: LimbPattern
    bend_lead_rad: float
    trunk: Mapping[str, float]
    sway: Mapping[str, float]
    sway_lead_rad: float
    twist: Mapping[str, float]
    steering_s: float
    full_turn_rad: float
    thigh_lag_rad: float


# result of experiments/crawl/search.py, continued by an evolution strategy after the joint dynamics
# had changed
CRAWL = GaitPattern(
    frequency_hz=1.81,
    leg=LimbPattern(
        {
            "thigh.flexion": JointSwing(96.9, 36.1, -25.0, -4.7),
            "thigh.abduction": JointSwing(4.7, -18.3, 37.4, -11.2),
            "shank.flexion": JointSwing(123.7, 10.5, 6.2, -20.0),
            "foot.dorsiflexion": JointSwing(-51.7, -3.2, 16.7, 18.8),
        },
        lead_rad=0.48,
        shortening=-0.97,
    ),
    arm=LimbPattern(
        {
            "upper_arm.flexion": JointSwing(66.1, -34.6, -28.1, -1.0),
            "upper_arm.abduction": JointSwing(65.0, -3.3, 31.4, 33.8),
            "forearm.flexion": JointSwing(2.3, -19.1, 66.2, 20.6),
            "hand.flexion": JointSwing(-63.3, 3.2, 24.8, -12.2),
        },
        lead_rad=3.1,
        shortening=0.34,
    ),
    bend_lead_rad=0.79,
    trunk={
        "head.flexion": -26.0,
        "neck.flexion": -69.2,
        "spine.flexion": 28.2,
    },
    sway={
        "chest.lateral": 26.8,
        "chest.rotation": 15.9,
        "spine.lateral": -2.6,
    },
    sway_lead_rad=0.06,
    twist={
        "chest.lateral": -2.9,
        "chest.rotation": 19.5,
        "spine.lateral": -40.4,
        "spine.rotation": 34.9,
    },
    steering_s=0.22,
    full_turn_rad=0.67,
    thigh_lag_rad=0.85,
)

# likewise; it does not steer
BACK = GaitPattern(
    frequency_hz=2.17,
    leg=LimbPattern(
        {
            "thigh.flexion": JointSwing(142.8, 1.4, -64.0),
            "thigh.abduction": JointSwing(8.3, -39.6, -18.0),
            "shank.flexion": JointSwing(138.1, -46.9, 17.8),
            "foot.dorsiflexion": JointSwing(-46.2, -7.9, 7.5),
        },
        lead_rad=0.01,
        shortening=0.0,
    ),
    arm=LimbPattern(
        {
            "upper_arm.flexion": JointSwing(96.4, -52.6, -65.9),
            "upper_arm.abduction": JointSwing(53.8, 1.3, 36.9),
            "forearm.flexion": JointSwing(9.3, -5.0, 78.0),
            "hand.flexion": JointSwing(-72.5, -37.5, 35.0),
        },
        lead_rad=1.93,
        shortening=0.0,
    ),
    bend_lead_rad=-0.59,
    trunk={
        "head.flexion": -64.8,
        "neck.flexion": -73.7,
        "spine.flexion": -6.1,
    },
    sway={
        "chest.lateral": 55.2,
        "chest.rotation": 4.2,
        "spine.lateral": -9.9,
    },
    sway_lead_rad=-0.36,
    twist={},
    steering_s=0.31,
    full_turn_rad=0.66,
    thigh_lag_rad=-2.94,
)


def _without_motion(pattern: GaitPattern) -> GaitPattern:
    def still(limb: LimbPattern) -> LimbPattern:
        joints = {name: JointSwing(joint.middle) for name, joint in limb.joints.items()}
        return replace(limb, joints=joints)

    return replace(pattern, leg=still(pattern.leg), arm=still(pattern.arm), sway={}, twist={})


# hands and knees at rest in the mean posture of the gait; the head is at rest after 0.6 s
KNEEL = _without_motion(CRAWL)


_FADE_IN_S = 0.4  # blend from the posture at the start to the gait


class CrawlGait:
    """Joint targets of a periodic gait, as a function of time and a turning command.

    Args:
        body: The body; the gait starts from its present joint angles.
        step_s: Duration of an environment step.
        pattern: Frequency, amplitudes and phases of the gait.

    Attributes:
        pattern: The same.
    """

    def __init__(self, body: Humanoid, step_s: float, pattern: GaitPattern = CRAWL) -> None:
        self.pattern, self._body, self._step_s = pattern, body, step_s
        self._index = {name: index for index, name in enumerate(body.joint_names)}
        self._time_s, self._turn, self._start = 0.0, 0.0, body.joint_angles()
        self._offset_rad = 0.0

    def towards(self, bearing_rad: float) -> JointCommand:
        """Return joint targets for one step that steer to a bearing.

        Args:
            bearing_rad: Angle of the goal to the left of straight ahead.
        """
        return self.command(min(max(bearing_rad / self.pattern.full_turn_rad, -1.0), 1.0))

    def command(self, turn: float = 0.0) -> JointCommand:
        """Return joint targets for one step.

        Args:
            turn: Turning command in [-1, 1], positive to the left. It is low-pass filtered with
                the time constant `GaitPattern.steering_s`.
        """
        share = min(1.0, self._time_s / _FADE_IN_S)
        phase = self.phase_rad
        self._turn += (turn - self._turn) * min(1.0, self._step_s / self.pattern.steering_s)
        self._time_s += self._step_s
        angles = self._start + share * (self._angles(phase) - self._start)
        return JointCommand(angles, horizon_s=self._step_s)

    def follow_body(self) -> None:
        """Set the phase to that which the body has, see `followed_rad`."""
        self._offset_rad += self.followed_rad() - self.phase_rad

    @property
    def phase_rad(self) -> float:
        """Phase of the next command."""
        return 2.0 * math.pi * self.pattern.frequency_hz * self._time_s + self._offset_rad

    def followed_rad(self) -> float:
        """Return the phase that the body follows: that of its thighs and their lag.

        The phase of the thighs is the angle in the phase plane of the difference d of their
        flexions, left less right: ``atan2(d, d' / (2 pi f))``, as in studies of human gait (Hamill,
        van Emmerik, Heiderscheit & Li 1999, Clin. Biomech. 14, 297).
        """
        left, right = (self._index[f"{side}_thigh.flexion"] for side in "lr")
        angles, rates = self._body.joint_angles(), self._body.joint_velocities()
        radians_per_s = 2.0 * math.pi * self.pattern.frequency_hz
        rate = (rates[left] - rates[right]) / radians_per_s
        return math.atan2(angles[left] - angles[right], rate) + self.pattern.thigh_lag_rad

    def _angles(self, phase: float) -> Floats:
        """Return the joint angles at a phase of the gait, ``(82,)`` rad."""
        pattern, degrees = self.pattern, np.zeros(len(self._index))
        for side, shift, turn in (("l_", 0.0, self._turn), ("r_", math.pi, -self._turn)):
            for limb in (pattern.leg, pattern.arm):
                self._set_limb(degrees, side, limb, phase + shift + limb.lead_rad, turn)
        sway = math.sin(phase + pattern.sway_lead_rad)
        for angles, share in (
            (pattern.trunk, 1.0),
            (pattern.sway, sway),
            (pattern.twist, self._turn),
        ):
            for name, angle in angles.items():
                degrees[self._index[name]] += share * angle
        return np.radians(degrees)

    def _set_limb(
        self, degrees: Floats, side: str, limb: LimbPattern, phase: float, turn: float
    ) -> None:
        """Set the joint angles of one limb; `turn` is positive to the limb's own side."""
        swing = math.sin(phase)
        bend = max(0.0, math.cos(phase + self.pattern.bend_lead_rad))
        scaled = swing * (1.0 - limb.shortening * turn)
        for name, joint in limb.joints.items():
            angle = joint.middle + joint.swing * scaled + joint.bend * bend
            degrees[self._index[side + name]] = angle + joint.sweep * turn * swing
