"""Parameters of the gaits on hands and knees: forwards, backwards and at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace


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


# result of experiments/crawl/search.py
CRAWL = GaitPattern(
    frequency_hz=1.81,
    leg=LimbPattern(
        {
            "thigh.flexion": JointSwing(96.9, 36.1, -25.0, -6.0),
            "thigh.abduction": JointSwing(4.7, -18.3, 37.4, 0.1),
            "shank.flexion": JointSwing(123.7, 10.5, 6.2, -14.4),
            "foot.dorsiflexion": JointSwing(-51.7, -3.2, 16.7, 20.0),
        },
        lead_rad=0.48,
        shortening=-0.53,
    ),
    arm=LimbPattern(
        {
            "upper_arm.flexion": JointSwing(66.1, -34.6, -28.1, 1.0),
            "upper_arm.abduction": JointSwing(65.0, -3.3, 31.4, 34.4),
            "forearm.flexion": JointSwing(2.3, -19.1, 66.2, 7.8),
            "hand.flexion": JointSwing(-63.3, 3.2, 24.8, -5.1),
        },
        lead_rad=3.1,
        shortening=0.04,
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
        "chest.lateral": -2.5,
        "chest.rotation": 25.5,
        "spine.lateral": -33.0,
        "spine.rotation": 43.6,
    },
    steering_s=0.31,
    full_turn_rad=0.66,
)

# result of experiments/crawl/search.py; it does not steer
BACK = GaitPattern(
    frequency_hz=2.04,
    leg=LimbPattern(
        {
            "thigh.flexion": JointSwing(136.7, -1.3, -82.7),
            "thigh.abduction": JointSwing(-1.3, -8.2, -11.4),
            "shank.flexion": JointSwing(126.1, -46.4, 36.9),
            "foot.dorsiflexion": JointSwing(-50.4, -21.7, -3.0),
        },
        lead_rad=-0.11,
        shortening=0.0,
    ),
    arm=LimbPattern(
        {
            "upper_arm.flexion": JointSwing(81.0, -34.9, -30.3),
            "upper_arm.abduction": JointSwing(66.0, 15.2, 20.8),
            "forearm.flexion": JointSwing(7.0, 13.2, 86.5),
            "hand.flexion": JointSwing(-59.1, -28.3, 33.7),
        },
        lead_rad=2.26,
        shortening=0.0,
    ),
    bend_lead_rad=0.08,
    trunk={
        "head.flexion": -60.1,
        "neck.flexion": -86.3,
        "spine.flexion": 7.1,
    },
    sway={
        "chest.lateral": 63.7,
        "chest.rotation": 6.8,
        "spine.lateral": 12.3,
    },
    sway_lead_rad=-0.05,
    twist={},
    steering_s=0.31,
    full_turn_rad=0.66,
)


def _without_motion(pattern: GaitPattern) -> GaitPattern:
    def still(limb: LimbPattern) -> LimbPattern:
        joints = {name: JointSwing(joint.middle) for name, joint in limb.joints.items()}
        return replace(limb, joints=joints)

    return replace(pattern, leg=still(pattern.leg), arm=still(pattern.arm), sway={}, twist={})


# hands and knees at rest in the mean posture of the gait; the head is at rest after 0.6 s
KNEEL = _without_motion(CRAWL)
