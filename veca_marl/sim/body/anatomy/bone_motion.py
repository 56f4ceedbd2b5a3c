"""Velocities of all bones from those of the pelvis and the joints."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy.kinematics import rotate_about_axis
from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.geometry import Floats


@njit(cache=True)
def _propagate(
    parents: NDArray[np.int64],
    rest_rotations: Floats,
    joint_axes: Floats,
    joint_slices: NDArray[np.int64],
    angles: Floats,
    speeds: Floats,
    positions: Floats,
    rotations: Floats,
    velocities: Floats,
    spins: Floats,
) -> None:
    """Write rows 1..: each joint adds its speed about its axis, rotated by the joints before it."""
    frame = np.empty((3, 3))
    for bone in range(1, parents.shape[0]):
        parent = parents[bone]
        for row in range(3):
            spins[bone, row] = spins[parent, row]
            for column in range(3):
                frame[row, column] = _product(rotations, rest_rotations, parent, bone, row, column)
        for joint in range(joint_slices[bone, 0], joint_slices[bone, 1]):
            x, y, z = joint_axes[joint, 0], joint_axes[joint, 1], joint_axes[joint, 2]
            for row in range(3):
                along = frame[row, 0] * x + frame[row, 1] * y + frame[row, 2] * z
                spins[bone, row] += speeds[joint] * along
            rotate_about_axis(frame, joint_axes[joint], angles[joint], frame)
        x = positions[bone, 0] - positions[parent, 0]
        y = positions[bone, 1] - positions[parent, 1]
        z = positions[bone, 2] - positions[parent, 2]
        u, v, w = spins[parent, 0], spins[parent, 1], spins[parent, 2]
        velocities[bone, 0] = velocities[parent, 0] + v * z - w * y
        velocities[bone, 1] = velocities[parent, 1] + w * x - u * z
        velocities[bone, 2] = velocities[parent, 2] + u * y - v * x


@njit(cache=True, inline="always")
def _product(a: Floats, b: Floats, i: int, j: int, row: int, column: int) -> float:
    """One element of a product of two matrices; numpy takes ten times as long for small ones."""
    return float(
        a[i, row, 0] * b[j, 0, column]
        + a[i, row, 1] * b[j, 1, column]
        + a[i, row, 2] * b[j, 2, column]
    )


def bone_motion(
    skeleton: Skeleton,
    angles: Floats,
    speeds: Floats,
    positions: Floats,
    rotations: Floats,
    pelvis_velocity: Floats,
    pelvis_spin: Floats,
) -> tuple[Floats, Floats]:
    """Return the velocities (m/s) of the origins and the angular velocities (rad/s) of all bones.

    Args:
        skeleton: The skeleton.
        angles: ``(82,)`` joint angles, rad.
        speeds: ``(82,)`` their rates, rad/s.
        positions: ``(47, 3)`` bone origins that belong to the angles, metres.
        rotations: ``(47, 3, 3)`` bone rotations that belong to the angles.
        pelvis_velocity: ``(3,)`` m/s, world axes.
        pelvis_spin: ``(3,)`` rad/s, world axes.

    Returns:
        Two arrays ``(47, 3)`` in world axes.
    """
    velocities, spins = np.zeros_like(positions), np.zeros_like(positions)
    velocities[0], spins[0] = pelvis_velocity, pelvis_spin
    _propagate(
        skeleton.parents,
        skeleton.rest_rotations,
        skeleton.joint_axes,
        skeleton.joint_slices,
        angles,
        speeds,
        np.ascontiguousarray(positions),
        np.ascontiguousarray(rotations),
        velocities,
        spins,
    )
    return velocities, spins
