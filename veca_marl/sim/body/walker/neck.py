"""Rotation of a walker's head by the joints of its neck and its head."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import Skeleton
from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel

_ROUNDING_RAD = 1e-9


class Neck:
    """Distributes rotations over the joints of neck and head, which reach their limits together.

    The head turns about the vertical axis and nods about its own axis from ear to ear, so that it
    does not roll: relative to a level frame its rotation is Rz(yaw) Ry(pitch).

    Args:
        skeleton: The table of bones and joints.

    Attributes:
        pitch_range_rad: Range of the pitch (down is positive) of a head that is not turned,
            relative to the trunk.
        yaw_range_rad: Range of the yaw (left is positive) of a head that is not pitched, likewise.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        labels = ("flexion", "lateral", "rotation")
        self._neck = [skeleton.joint("neck", label) for label in labels]
        self._head = [skeleton.joint("head", label) for label in labels]
        self._pairs: NDArray[np.int64] = np.array([self._neck, self._head]).T
        self._low = np.array([joint.low_rad for joint in skeleton.joints])
        self._high = np.array([joint.high_rad for joint in skeleton.joints])
        self.pitch_range_rad = self._range_rad(self._pairs[0])
        self.yaw_range_rad = self._range_rad(self._pairs[2])

    def _range_rad(self, joints: NDArray[np.int64]) -> tuple[float, float]:
        """Return the sums of the least and of the greatest angles of some joints."""
        return float(self._low[joints].sum()), float(self._high[joints].sum())

    def turn(self, angles: Floats, pitch_rad: float, yaw_rad: float, level_rad: float) -> None:
        """Set the angles of neck and head.

        Args:
            angles: ``(82,)`` rad: joint angles; those of neck and head are changed.
            pitch_rad: Pitch of the head relative to the trunk.
            yaw_rad: Yaw of the head about the vertical axis.
            level_rad: Pitch relative to the trunk at which the head is level.
        """
        if yaw_rad == 0.0:
            self._distribute(angles, (pitch_rad, 0.0, 0.0))
            return
        rotation = _about_y(level_rad) @ _about_z(yaw_rad) @ _about_y(pitch_rad - level_rad)
        self._distribute(angles, _bends(rotation))
        # bends of two joints one after the other are not their sum: the head makes up the rest
        flexion, lateral, turn = angles[self._neck]
        of_neck = _about_y(flexion) @ _about_x(-lateral) @ _about_z(turn)
        angles[self._head] = _bends(of_neck.T @ rotation)

    def reaches(self, pitch_rad: float, yaw_rad: float, level_rad: float) -> bool:
        """Return whether the joints can turn a head as `turn` does."""
        angles = np.zeros(len(self._low))
        self.turn(angles, pitch_rad, yaw_rad, level_rad)
        joints = [*self._neck, *self._head]
        beyond = np.maximum(self._low - angles, angles - self._high)[joints]
        return bool((beyond <= _ROUNDING_RAD).all())

    def _distribute(self, angles: Floats, bends: tuple[float, float, float]) -> None:
        _distribute(angles, bends, self._pairs, self._low, self._high)


@kernel
def _distribute(
    angles: Floats,
    bends: tuple[float, float, float],
    pairs: NDArray[np.int64],
    low: Floats,
    high: Floats,
) -> None:
    """Divide flexion, lateral bend and turn in the ratio of the limits of both joints.

    Args:
        angles: ``(82,)`` rad; those of neck and head are changed.
        bends: Flexion, lateral bend and turn of the head relative to the trunk, rad.
        pairs: ``(3, 2)`` joints of neck and head for each of them.
        low: ``(82,)`` rad, lower limits.
        high: ``(82,)`` rad, upper limits.
    """
    for axis in range(3):
        limits = high if bends[axis] >= 0.0 else low
        total = limits[pairs[axis, 0]] + limits[pairs[axis, 1]]
        for joint in pairs[axis]:
            angles[joint] = bends[axis] * limits[joint] / total


def _bends(rotation: Floats) -> tuple[float, float, float]:
    """Return the angles a, b, c (rad) of a rotation Ry(a) Rx(-b) Rz(c): flexion, lateral, turn."""
    return (
        math.atan2(rotation[0, 2], rotation[2, 2]),
        math.asin(min(max(rotation[1, 2], -1.0), 1.0)),
        math.atan2(rotation[1, 0], rotation[1, 1]),
    )


def _about_x(angle_rad: float) -> Floats:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_y(angle_rad: float) -> Floats:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _about_z(angle_rad: float) -> Floats:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
