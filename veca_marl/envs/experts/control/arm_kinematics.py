"""Inverse kinematics of both arms by damped least squares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton, forward_kinematics
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.geometry import Floats

_SIDES = ("l", "r")
_ARM = ("upper_arm", "forearm", "hand")
_PALM_M = 0.042  # from the wrist along the hand; near the fingers, clear of the forearm
_THICKNESS_M = 0.0095  # from the middle of the hand to the skin of the palm
_INWARD = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])  # normals of the palms, hand frames
_DIFFERENCE_RAD = 1e-4  # step of the finite differences
_DAMPING = 0.03


class Palms(NamedTuple):
    """Poses of both palms, left first.

    Attributes:
        points: ``(2, 3)`` metres: on the skin of each palm, near the fingers, world frame.
        normals: ``(2, 3)`` unit vectors out of the palms.
        fingers: ``(2, 3)`` unit vectors along the straight fingers.
    """

    points: Floats
    normals: Floats
    fingers: Floats


class ArmKinematics:
    """Forward and inverse kinematics of the arms of a body.

    Attributes:
        joints: Indices of the joints of both arms and hands without fingers.

    Args:
        body: The body.
        max_change_rad: Largest change of a joint angle per call of `reach`.
        direction_m: Weight of an error of direction, metres per radian.
    """

    def __init__(
        self, body: Humanoid, max_change_rad: float = 0.12, direction_m: float = 0.06
    ) -> None:
        self._body = body
        self._max_change_rad, self._direction_m = max_change_rad, direction_m
        self._skeleton: Skeleton = body.skeleton
        bones = self._skeleton.bones
        arms = [self._skeleton.bone(f"{side}_{bone}") for side in _SIDES for bone in _ARM]
        self.joints = [
            bones[arm].first_joint + joint
            for arm in arms
            for joint in range(bones[arm].joint_count)
        ]
        self._hands = [self._skeleton.bone(f"{side}_hand") for side in _SIDES]
        joints = [self._skeleton.joints[joint] for joint in self.joints]
        hand = body.growth.hand
        self._along_m, self._out_m = _PALM_M * hand.z, _THICKNESS_M * hand.girth
        self._low = np.array([joint.low_rad for joint in joints])
        self._high = np.array([joint.high_rad for joint in joints])

    def palms(self) -> Palms:
        """Return the present poses of the palms."""
        return self._palms(self._body.bone_positions(), self._body.bone_rotations())

    def reach(
        self, angles: Floats, palms: Palms, iterations: int = 4, trunk: Floats | None = None
    ) -> Floats:
        """Return joint angles ``(82,)`` rad with those of the arms replaced by a solution.

        The pose of the pelvis is the present one.

        Args:
            angles: ``(82,)`` rad; the solver starts from those of the arms.
            palms: Target poses; unreachable ones are approached.
            iterations: Number of Gauss-Newton steps.
            trunk: ``(82,)`` rad, the joint angles of the trunk for which the arms are solved; the
                present ones by default.
        """
        trial = self._body.joint_angles() if trunk is None else trunk.copy()
        trial[self.joints] = angles[self.joints]
        low = np.maximum(angles[self.joints] - self._max_change_rad, self._low)
        high = np.minimum(angles[self.joints] + self._max_change_rad, self._high)
        for _ in range(iterations):
            change = self._gauss_newton(trial, palms)
            trial[self.joints] = np.clip(trial[self.joints] + change, low, high)
        reached = angles.copy()
        reached[self.joints] = trial[self.joints]
        return reached

    def _gauss_newton(self, angles: Floats, palms: Palms) -> Floats:
        """Return the change of the arms' angles of one damped Gauss-Newton step."""
        positions, rotations = self._body.bone_positions(), self._body.bone_rotations()

        def error(trial: Floats) -> Floats:
            forward_kinematics(self._skeleton, trial, positions, rotations)
            return _difference(self._palms(positions, rotations), palms, self._direction_m)

        here = error(angles)
        jacobian = np.empty((len(here), len(self.joints)))
        for column, joint in enumerate(self.joints):
            shifted = angles.copy()
            shifted[joint] += _DIFFERENCE_RAD
            jacobian[:, column] = (error(shifted) - here) / _DIFFERENCE_RAD
        normal = jacobian.T @ jacobian + _DAMPING**2 * np.eye(len(self.joints))
        return np.asarray(np.linalg.solve(normal, -jacobian.T @ here), np.float64)

    def _palms(self, positions: Floats, rotations: Floats) -> Palms:
        hands = rotations[self._hands]
        fingers = -hands[:, :, 2]
        normals = np.einsum("hij,hj->hi", hands, _INWARD)
        points = positions[self._hands] + self._along_m * fingers + self._out_m * normals
        return Palms(points, normals, fingers)


def _difference(palms: Palms, wanted: Palms, direction_m: float) -> Floats:
    """Return the errors of palm poses, ``(18,)`` metres; those of directions are weighted."""
    return np.concatenate(
        [
            (palms.points - wanted.points).ravel(),
            direction_m * (palms.normals - wanted.normals).ravel(),
            direction_m * (palms.fingers - wanted.fingers).ravel(),
        ]
    )
