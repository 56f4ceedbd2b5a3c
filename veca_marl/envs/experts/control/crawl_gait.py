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
)


def _without_motion(pattern: GaitPattern) -> GaitPattern:
    def still(limb: LimbPattern) -> LimbPattern:
        joints = {name: JointSwing(joint.middle) for name, joint in limb.joints.items()}
        return replace(limb, joints=joints)

    return replace(pattern, leg=still(pattern.leg), arm=still(pattern.arm), sway={}, twist={})


# hands and knees at rest in the mean posture of the gait; the head is at rest after 0.6 s
KNEEL = _without_motion(CRAWL)
