"""Crawling on hands and knees as an open-loop gait: knee and opposite hand move together."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.envs.experts.control.crawl_gait import CRAWL, GaitPattern, LimbPattern
from veca_marl.sim.body.humanoid import Humanoid, JointCommand
from veca_marl.sim.geometry import Floats

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
        self.pattern, self._step_s = pattern, step_s
        self._index = {name: index for index, name in enumerate(body.joint_names)}
        self._time_s, self._turn, self._start = 0.0, 0.0, body.joint_angles()

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
        phase = 2.0 * math.pi * self.pattern.frequency_hz * self._time_s
        self._turn += (turn - self._turn) * min(1.0, self._step_s / self.pattern.steering_s)
        self._time_s += self._step_s
        angles = self._start + share * (self._angles(phase) - self._start)
        return JointCommand(angles, horizon_s=self._step_s)

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
