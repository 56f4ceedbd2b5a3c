"""Both palms to points in the world: inverse kinematics of the arms by damped least squares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Skeleton, forward_kinematics, load_skeleton
from veca_marl.sim.body.humanoid.humanoid import Humanoid
from veca_marl.sim.geometry.pose import Floats

_SIDES = ("l", "r")
_ARM = ("upper_arm", "forearm", "hand")
_PALM = 0.042  # from the wrist along the hand: near the fingers, where no forearm is in the way
_THICKNESS = 0.0095  # from the middle of the hand to the skin of the palm
_INWARD = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])  # normals of the palms, hand frames
_NUDGE_RAD = 1e-4
_DAMPING = 0.03
_FASTEST_RAD = 0.12  # of a joint, per call: what is far away is approached, not jumped to
_TURN_M = 0.06  # a direction that is wrong by 1 rad counts as a palm that is so far off


class Palms(NamedTuple):
    """Where both palms are, left first.

    Attributes:
        points: ``(2, 3)`` metres: on the skin of each palm, near the fingers, world frame.
        normals: ``(2, 3)`` unit vectors out of the palms.
        fingers: ``(2, 3)`` unit vectors along the straight fingers.
    """

    points: Floats
    normals: Floats
    fingers: Floats


class ArmKinematics:
    """The arms of a body.

    Args:
        body: Whose arms.
    """

    def __init__(self, body: Humanoid) -> None:
        self._body = body
        self._skeleton: Skeleton = load_skeleton()
        bones = self._skeleton.bones
        arms = [self._skeleton.bone(f"{side}_{bone}") for side in _SIDES for bone in _ARM]
        self._joints = [
            bones[arm].first_joint + joint
            for arm in arms
            for joint in range(bones[arm].joint_count)
        ]
        self._hands = [self._skeleton.bone(f"{side}_hand") for side in _SIDES]
        joints = [self._skeleton.joints[joint] for joint in self._joints]
        self._low = np.array([joint.low_rad for joint in joints])
        self._high = np.array([joint.high_rad for joint in joints])

    def palms(self) -> Palms:
        """Return where the palms are."""
        return self._palms(self._body.bone_positions(), self._body.bone_rotations())

    def reach(self, wish: Floats, palms: Palms, iterations: int = 4) -> Floats:
        """Return the angles ``(82,)`` of a wish with the arms' angles replaced.

        The trunk is taken as it is now; the arms start from the wish's angles.

        Args:
            wish: ``(82,)`` rad.
            palms: Where the palms shall come to; what cannot be reached is approached.
            iterations: Steps of Gauss and Newton.
        """
        angles = self._body.joint_angles()
        angles[self._joints] = wish[self._joints]
        low = np.maximum(wish[self._joints] - _FASTEST_RAD, self._low)
        high = np.minimum(wish[self._joints] + _FASTEST_RAD, self._high)
        positions, rotations = self._body.bone_positions(), self._body.bone_rotations()

        def off(trial: Floats) -> Floats:
            forward_kinematics(self._skeleton, trial, positions, rotations)
            return _difference(self._palms(positions, rotations), palms)

        for _ in range(iterations):
            here = off(angles)
            slopes = np.empty((len(here), len(self._joints)))
            for column, joint in enumerate(self._joints):
                nudged = angles.copy()
                nudged[joint] += _NUDGE_RAD
                slopes[:, column] = (off(nudged) - here) / _NUDGE_RAD
            normal = slopes.T @ slopes + _DAMPING**2 * np.eye(len(self._joints))
            turns = np.linalg.solve(normal, -slopes.T @ here)
            angles[self._joints] = np.clip(angles[self._joints] + turns, low, high)
        reached = wish.copy()
        reached[self._joints] = angles[self._joints]
        return reached

    def _palms(self, positions: Floats, rotations: Floats) -> Palms:
        turns = rotations[self._hands]
        fingers = -turns[:, :, 2]
        normals = np.einsum("hij,hj->hi", turns, _INWARD)
        points = positions[self._hands] + _PALM * fingers + _THICKNESS * normals
        return Palms(points, normals, fingers)


def _difference(palms: Palms, wanted: Palms) -> Floats:
    """Return how far palms are from those wanted, ``(18,)`` metres."""
    return np.concatenate(
        [
            (palms.points - wanted.points).ravel(),
            _TURN_M * (palms.normals - wanted.normals).ravel(),
            _TURN_M * (palms.fingers - wanted.fingers).ravel(),
        ]
    )
