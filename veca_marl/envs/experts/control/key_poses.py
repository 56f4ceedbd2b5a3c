"""Going through key poses: what the experts of the joint-level tasks have in common."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry.pose import Floats


class KeyPoses:
    """Leads the joints of a body from one key pose to the next, at a limited speed.

    Args:
        body: Whose joints.
        poses: The key poses by name; only their joint angles count.
        step_s: Time between two wishes.
    """

    def __init__(self, body: Humanoid, poses: Mapping[str, Posture], step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._angles = {name: body.angles_of(pose) for name, pose in poses.items()}
        self.reset()

    def reset(self) -> None:
        """Begin where the joints are."""
        self._wish = self._body.joint_angles()

    def toward(self, name: str, speed_radps: float) -> Floats:
        """Return the ``(82,)`` angles to wish for now, on the way to a key pose.

        Args:
            name: Of the key pose.
            speed_radps: How fast each wished angle moves.
        """
        stride_rad = speed_radps * self._step_s
        way = self._angles[name] - self._wish
        self._wish = self._wish + np.clip(way, -stride_rad, stride_rad)
        return self._wish.copy()
