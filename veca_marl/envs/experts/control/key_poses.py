"""Rate-limited motion of all joints from one key pose to the next."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import Posture
from veca_marl.sim.geometry import Floats


class KeyPoses:
    """Target angles that move to a key pose at a limited speed.

    Args:
        body: The body.
        poses: Key poses by name; only their joint angles are used.
        step_s: Duration of an environment step.

    Attributes:
        targets: The target angles of the last step, ``(82,)`` rad.
    """

    def __init__(self, body: Humanoid, poses: Mapping[str, Posture], step_s: float) -> None:
        self._body, self._step_s = body, step_s
        self._poses = {name: body.posture_angles(pose) for name, pose in poses.items()}
        self.reset()

    def reset(self, targets: Floats | None = None) -> None:
        """Start from target angles, ``(82,)`` rad; None are the present joint angles."""
        self.targets = self._body.joint_angles() if targets is None else targets.copy()

    def toward(self, name: str, speed_radps: float) -> Floats:
        """Return the target angles of the next step, ``(82,)`` rad.

        Args:
            name: Name of the key pose.
            speed_radps: Speed of each target angle.
        """
        limit_rad = speed_radps * self._step_s
        change = self._poses[name] - self.targets
        self.targets = self.targets + np.clip(change, -limit_rad, limit_rad)
        return self.targets.copy()
