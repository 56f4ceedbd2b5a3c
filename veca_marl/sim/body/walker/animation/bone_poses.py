"""The bones of a walker, posed by forward kinematics from gait, stance and head."""

from __future__ import annotations

import math

from veca_marl.sim.body.anatomy import Skeleton, forward_kinematics
from veca_marl.sim.body.walker.animation.neck import Neck
from veca_marl.sim.body.walker.stances import Stance
from veca_marl.sim.geometry import Floats, SceneObject


class BonePoses:
    """Writes the poses of the 47 bones of a walker into the scene.

    Args:
        skeleton: The table of bones and joints.
        bones: The object of the scene with a frame for each bone.
    """

    def __init__(self, skeleton: Skeleton, bones: SceneObject) -> None:
        self._skeleton, self._bones = skeleton, bones
        self._yaw_range_rad = Neck(skeleton).yaw_range_rad
        self._head_pitch_rad = self._head_yaw_rad = 0.0

    def reset(self, head_pitch_rad: float) -> None:
        """Look straight ahead with a pitch of the head; down is positive."""
        self._head_pitch_rad, self._head_yaw_rad = head_pitch_rad, 0.0

    def pitch_head(self, deg: float, stance: Stance) -> None:
        """Turn the head down by an angle, clipped to its range in a stance.

        Raises:
            ValueError: If the angle is not finite.
        """
        range_rad = stance.pitch_range_rad
        angle_rad = _clipped(self._head_pitch_rad, range_rad) + _finite_rad(deg)
        self._head_pitch_rad = _clipped(angle_rad, range_rad)

    def yaw_head(self, deg: float) -> None:
        """Turn the head to the left by an angle, clipped to its range.

        Raises:
            ValueError: If the angle is not finite.
        """
        angle_rad = self._head_yaw_rad + _finite_rad(deg)
        self._head_yaw_rad = _clipped(angle_rad, self._yaw_range_rad)

    def write(self, stance: Stance, ground: Floats, yaw_rad: float, surface_m: float) -> Floats:
        """Compute all bone poses, shifted vertically until the body touches the surface.

        Args:
            stance: The present stance.
            ground: ``(2,)`` metres, position on the floor plan.
            yaw_rad: Heading.
            surface_m: Height of the surface under the walker.

        Returns:
            The joint angles, ``(82,)`` rad; the array belongs to the stance.
        """
        positions, rotations = self._bones.positions, self._bones.rotations
        positions[0], rotations[0] = stance.pelvis(ground, yaw_rad)
        pitch_rad = _clipped(self._head_pitch_rad, stance.pitch_range_rad)
        angles = stance.angles(pitch_rad, self._head_yaw_rad)
        forward_kinematics(self._skeleton, angles, positions, rotations)
        positions[:, 2] -= stance.underside.lowest_m(positions, rotations) - surface_m
        return angles


def _finite_rad(deg: float) -> float:
    """Return an angle in radians; raise `ValueError` if it is not finite."""
    if not math.isfinite(deg):
        raise ValueError(f"cannot turn the head by {deg} degrees")
    return math.radians(deg)


def _clipped(angle_rad: float, range_rad: tuple[float, float]) -> float:
    low, high = range_rad
    return min(max(angle_rad, low), high)
