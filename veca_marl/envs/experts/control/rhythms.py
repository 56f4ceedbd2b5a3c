"""Rhythms of hands and knees, in numbers: ahead, back, and none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Swing:
    """How a joint of a limb moves in a stride, degrees.

    Attributes:
        middle: About which angle.
        swing: How far to and fro with its limb.
        bend: And how much besides while the limb goes forward.
        sweep: How far to and fro, besides, at a full turn to the limb's own side.
    """

    middle: float
    swing: float = 0.0
    bend: float = 0.0
    sweep: float = 0.0


@dataclass(frozen=True)
class Limb:
    """How a limb strides.

    Attributes:
        joints: Its joints.
        lead_rad: How far it is ahead of the knee of its own side.
        shortening: By what share it swings less at a full turn to its own side.
    """

    joints: Mapping[str, Swing]
    lead_rad: float
    shortening: float


@dataclass(frozen=True)
class Rhythm:
    """How a body crawls.

    Attributes:
        frequency_hz: Of strides.
        leg: The left one; the right one is half a stride behind.
        arm: Likewise.
        bend_early_rad: Limbs bend so much before they swing forward.
        trunk: Angles of the trunk, degrees.
        sway: How far the trunk moves to and fro in a stride, degrees.
        sway_lead_rad: How far this is ahead of the left knee.
        twist: What a full turn to the left adds to the trunk, degrees.
        steering_s: Time constant of a change of the turn.
        full_turn_rad: So far to the side of the way a full turn is due.
    """

    frequency_hz: float
    leg: Limb
    arm: Limb
    bend_early_rad: float
    trunk: Mapping[str, float]
    sway: Mapping[str, float]
    sway_lead_rad: float
    twist: Mapping[str, float]
    steering_s: float
    full_turn_rad: float


# Found by experiments/crawl/search.py
CRAWL = Rhythm(
    frequency_hz=1.67,
    leg=Limb(
        {
            "thigh.flexion": Swing(88.8, 35.8, -20.5, -6.0),
            "thigh.abduction": Swing(-6.0, -20.9, 39.9, 0.1),
            "shank.flexion": Swing(113.9, 6.2, 3.7, -14.4),
            "foot.dorsiflexion": Swing(-49.8, -6.2, -0.4, 20.0),
        },
        lead_rad=0.42,
        shortening=-0.53,
    ),
    arm=Limb(
        {
            "upper_arm.flexion": Swing(62.6, -31.3, -24.9, 1.0),
            "upper_arm.abduction": Swing(60.0, -1.2, 23.4, 34.4),
            "forearm.flexion": Swing(-2.6, -13.3, 59.4, 7.8),
            "hand.flexion": Swing(-65.6, -3.2, 31.1, -5.1),
        },
        lead_rad=2.70,
        shortening=0.04,
    ),
    bend_early_rad=0.82,
    trunk={
        "head.flexion": -31.8,
        "neck.flexion": -66.5,
        "spine.flexion": 25.2,
    },
    sway={
        "chest.lateral": 25.6,
        "chest.rotation": 8.7,
        "spine.lateral": -0.6,
    },
    sway_lead_rad=0.36,
    twist={
        "chest.lateral": -2.5,
        "chest.rotation": 25.5,
        "spine.lateral": -33.0,
        "spine.rotation": 43.6,
    },
    steering_s=0.31,
    full_turn_rad=0.66,
)

# Likewise; it goes straight
BACK = Rhythm(
    frequency_hz=2.04,
    leg=Limb(
        {
            "thigh.flexion": Swing(136.7, -1.3, -82.7),
            "thigh.abduction": Swing(-1.3, -8.2, -11.4),
            "shank.flexion": Swing(126.1, -46.4, 36.9),
            "foot.dorsiflexion": Swing(-50.4, -21.7, -3.0),
        },
        lead_rad=-0.11,
        shortening=0.0,
    ),
    arm=Limb(
        {
            "upper_arm.flexion": Swing(81.0, -34.9, -30.3),
            "upper_arm.abduction": Swing(66.0, 15.2, 20.8),
            "forearm.flexion": Swing(7.0, 13.2, 86.5),
            "hand.flexion": Swing(-59.1, -28.3, 33.7),
        },
        lead_rad=2.26,
        shortening=0.0,
    ),
    bend_early_rad=0.08,
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


def _at_rest(rhythm: Rhythm) -> Rhythm:
    def kneeling(limb: Limb) -> Limb:
        joints = {name: Swing(joint.middle) for name, joint in limb.joints.items()}
        return replace(limb, joints=joints)

    return replace(rhythm, leg=kneeling(rhythm.leg), arm=kneeling(rhythm.arm), sway={}, twist={})


KNEEL = _at_rest(CRAWL)  # the middle of all swings: the head is still after 0.6 s
