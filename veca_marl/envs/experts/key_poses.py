"""Going through key poses: what the experts of the joint-level tasks have in common."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from veca_marl.sim.bodies.humanoid import Humanoid
from veca_marl.sim.bodies.postures import Posture
from veca_marl.sim.pose import Floats


class KeyPoses:
    """Leads the joints of a body from one key pose to the next, no faster than they should go.

    Args:
        body: Whose joints.
        poses: The key poses by name; only their joint angles count.
        speed_radps: How fast the wished angles move.
        step_s: Time between two wishes.
    """

    def __init__(
        self, body: Humanoid, poses: Mapping[str, Posture], speed_radps: float, step_s: float
    ) -> None:
        self._body = body
        self._angles = {name: body.angles_of(pose) for name, pose in poses.items()}
        self._stride_rad = speed_radps * step_s
        self.reset()

    def reset(self) -> None:
        """Begin where the joints are."""
        self._wish = self._body.joint_angles()

    def toward(self, name: str) -> Floats:
        """Return the ``(82,)`` angles to wish for now, on the way to a key pose."""
        way = self._angles[name] - self._wish
        self._wish = self._wish + np.clip(way, -self._stride_rad, self._stride_rad)
        return self._wish.copy()
