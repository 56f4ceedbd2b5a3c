"""Neck and head of a walker, which turn together."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton
from veca_marl.sim.geometry import Floats


class Neck:
    """Distributes rotations over the joints of neck and head, which reach their limits together.

    Args:
        skeleton: The table of bones and joints.

    Attributes:
        pitch_range_rad: Range of the head's pitch (down is positive) relative to the trunk.
        yaw_range_rad: Range of its yaw (left is positive), likewise.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._pitch = [skeleton.joint(bone, "flexion") for bone in ("neck", "head")]
        self._yaw = [skeleton.joint(bone, "rotation") for bone in ("neck", "head")]
        self._low = np.array([joint.low_rad for joint in skeleton.joints])
        self._high = np.array([joint.high_rad for joint in skeleton.joints])
        self.pitch_range_rad = self._range_rad(self._pitch)
        self.yaw_range_rad = self._range_rad(self._yaw)

    def _range_rad(self, joints: list[int]) -> tuple[float, float]:
        """Return the sums of the least and of the greatest angles of some joints."""
        return float(self._low[joints].sum()), float(self._high[joints].sum())

    def turn(self, angles: Floats, pitch_rad: float, yaw_rad: float) -> None:
        """Set the angles of neck and head.

        Args:
            angles: ``(82,)`` rad: joint angles; those of neck and head are changed.
            pitch_rad: Pitch of the head in `pitch_range_rad`.
            yaw_rad: Yaw of the head in `yaw_range_rad`.
        """
        self._distribute(angles, self._pitch, pitch_rad, self.pitch_range_rad)
        self._distribute(angles, self._yaw, yaw_rad, self.yaw_range_rad)

    def _distribute(
        self, angles: Floats, joints: list[int], turn_rad: float, range_rad: tuple[float, float]
    ) -> None:
        upwards = turn_rad >= 0.0
        limits, total = (self._high, range_rad[1]) if upwards else (self._low, range_rad[0])
        for joint in joints:
            angles[joint] = turn_rad * limits[joint] / total
