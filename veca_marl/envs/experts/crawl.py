"""Crawling on hands and knees: each knee moves with the hand of the other side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from veca_marl.sim.bodies.humanoid import Humanoid
from veca_marl.sim.bodies.joint_controls import Springs
from veca_marl.sim.pose import Floats

_BEGIN_S = 0.4  # until then the rhythm grows out of the posture at the start


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


class Crawl:
    """A rhythm in time.

    Args:
        body: Who crawls; it begins where its joints are now.
        step_s: Time between two wishes.
        rhythm: How it crawls.
    """

    def __init__(self, body: Humanoid, step_s: float, rhythm: Rhythm = CRAWL) -> None:
        self._step_s, self._rhythm = step_s, rhythm
        self._joint = {name: index for index, name in enumerate(body.joint_names)}
        self._time_s, self._turn, self._start = 0.0, 0.0, body.joint_angles()

    def towards(self, aside_rad: float) -> Springs:
        """Return where springs shall pull the joints now, for who wants to get to a place.

        Args:
            aside_rad: How far to the left of straight ahead the place is.
        """
        return self.wish(min(max(aside_rad / self._rhythm.full_turn_rad, -1.0), 1.0))

    def wish(self, turn: float = 0.0) -> Springs:
        """Return where springs shall pull the joints now.

        Args:
            turn: How much to turn while crawling, in [-1, 1], left is positive; it is come to
                little by little.
        """
        share = min(1.0, self._time_s / _BEGIN_S)
        phase = 2.0 * math.pi * self._rhythm.frequency_hz * self._time_s
        self._turn += (turn - self._turn) * min(1.0, self._step_s / self._rhythm.steering_s)
        self._time_s += self._step_s
        angles = self._start + share * (self._angles(phase) - self._start)
        return Springs(angles, ahead_s=self._step_s)

    def _angles(self, phase: float) -> Floats:
        rhythm, degrees = self._rhythm, np.zeros(len(self._joint))
        for side, shift, turn in (("l_", 0.0, self._turn), ("r_", math.pi, -self._turn)):
            for limb in (rhythm.leg, rhythm.arm):
                self._stride(degrees, side, limb, phase + shift + limb.lead_rad, turn)
        sway = math.sin(phase + rhythm.sway_lead_rad)
        for angles, share in ((rhythm.trunk, 1.0), (rhythm.sway, sway), (rhythm.twist, self._turn)):
            for name, angle in angles.items():
                degrees[self._joint[name]] += share * angle
        return np.radians(degrees)

    def _stride(self, degrees: Floats, side: str, limb: Limb, phase: float, turn: float) -> None:
        """Set the joints of a limb; `turn` is to its own side."""
        across = math.sin(phase)
        forward = max(0.0, math.cos(phase + self._rhythm.bend_early_rad))
        swung = across * (1.0 - limb.shortening * turn)
        for name, joint in limb.joints.items():
            angle = joint.middle + joint.swing * swung + joint.bend * forward
            degrees[self._joint[side + name]] = angle + joint.sweep * turn * across
