"""Crawling on hands and knees: each knee moves with the hand of the other side."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.control.rhythms import CRAWL, Limb, Rhythm
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.joint_controls import Springs
from veca_marl.sim.geometry.pose import Floats

_BEGIN_S = 0.4  # until then the rhythm grows out of the posture at the start


class Crawl:
    """A rhythm in time.

    Args:
        body: Who crawls; it begins where its joints are now.
        step_s: Time between two wishes.
        rhythm: How it crawls.

    Attributes:
        rhythm: Likewise.
    """

    def __init__(self, body: Humanoid, step_s: float, rhythm: Rhythm = CRAWL) -> None:
        self.rhythm, self._step_s = rhythm, step_s
        self._joint = {name: index for index, name in enumerate(body.joint_names)}
        self._time_s, self._turn, self._start = 0.0, 0.0, body.joint_angles()

    def towards(self, aside_rad: float) -> Springs:
        """Return where springs shall pull the joints now, for who wants to get to a place.

        Args:
            aside_rad: How far to the left of straight ahead the place is.
        """
        return self.wish(min(max(aside_rad / self.rhythm.full_turn_rad, -1.0), 1.0))

    def wish(self, turn: float = 0.0) -> Springs:
        """Return where springs shall pull the joints now.

        Args:
            turn: How much to turn while crawling, in [-1, 1], left is positive; it is come to
                little by little.
        """
        share = min(1.0, self._time_s / _BEGIN_S)
        phase = 2.0 * math.pi * self.rhythm.frequency_hz * self._time_s
        self._turn += (turn - self._turn) * min(1.0, self._step_s / self.rhythm.steering_s)
        self._time_s += self._step_s
        angles = self._start + share * (self._angles(phase) - self._start)
        return Springs(angles, ahead_s=self._step_s)

    def _angles(self, phase: float) -> Floats:
        rhythm, degrees = self.rhythm, np.zeros(len(self._joint))
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
        forward = max(0.0, math.cos(phase + self.rhythm.bend_early_rad))
        swung = across * (1.0 - limb.shortening * turn)
        for name, joint in limb.joints.items():
            angle = joint.middle + joint.swing * swung + joint.bend * forward
            degrees[self._joint[side + name]] = angle + joint.sweep * turn * across
