"""Forward kinematics of the skeleton: positions and velocities of all bones."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.geometry import Floats


@njit(cache=True)
def rotate_about_axis(rotation: Floats, axis: Floats, angle: float, out: Floats) -> None:
    """Write `rotation` times the rotation about an axis (Rodrigues) to `out`, also in place."""
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    d = 1.0 - c
    m00, m01, m02 = x * x * d + c, x * y * d - z * s, x * z * d + y * s
    m10, m11, m12 = y * x * d + z * s, y * y * d + c, y * z * d - x * s
    m20, m21, m22 = z * x * d - y * s, z * y * d + x * s, z * z * d + c
    for i in range(3):
        a, b, e = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        out[i, 0] = a * m00 + b * m10 + e * m20
        out[i, 1] = a * m01 + b * m11 + e * m21
        out[i, 2] = a * m02 + b * m12 + e * m22


@njit(cache=True)
def _kinematics(
    parents: NDArray[np.int64],
    origins: Floats,
    rest_rotations: Floats,
    joint_axes: Floats,
    joint_slices: NDArray[np.int64],
    angles: Floats,
    positions: Floats,
    rotations: Floats,
) -> None:
    """Write rows 1.. of positions and rotations; row 0 (the pelvis) is given."""
    for bone in range(1, parents.shape[0]):
        up = rotations[parents[bone]]
        for i in range(3):
            total = positions[parents[bone], i]
            for k in range(3):
                total += up[i, k] * origins[bone, k]
            positions[bone, i] = total
            for j in range(3):
                value = 0.0
                for k in range(3):
                    value += up[i, k] * rest_rotations[bone, k, j]
                rotations[bone, i, j] = value
        for joint in range(joint_slices[bone, 0], joint_slices[bone, 1]):
            rotate_about_axis(rotations[bone], joint_axes[joint], angles[joint], rotations[bone])


def forward_kinematics(
    skeleton: Skeleton, angles: Floats, positions: Floats, rotations: Floats
) -> None:
    """Compute the poses of all bones from the pose of the pelvis and the joint angles.

    Args:
        skeleton: The skeleton.
        angles: ``(82,)`` joint angles, rad.
        positions: ``(47, 3)`` bone origins in the world, metres; row 0 is read, the rest written.
        rotations: ``(47, 3, 3)`` bone rotations to the world; row 0 is read, the rest written.
    """
    _kinematics(
        skeleton.parents,
        skeleton.origins,
        skeleton.rest_rotations,
        skeleton.joint_axes,
        skeleton.joint_slices,
        angles,
        positions,
        rotations,
    )
