"""How fast bones move, from how fast the pelvis and the joints do."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.pose import Floats
from veca_marl.sim.skeleton import Skeleton, turn


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
    """Fill rows 1..: each joint adds its speed about its axis as its predecessors turned it."""
    frame = np.empty((3, 3))
    for bone in range(1, parents.shape[0]):
        parent = parents[bone]
        spins[bone] = spins[parent]
        frame[:] = rotations[parent] @ rest_rotations[bone]
        for joint in range(joint_slices[bone, 0], joint_slices[bone, 1]):
            spins[bone] += speeds[joint] * (frame @ joint_axes[joint])
            turn(frame, joint_axes[joint], angles[joint], frame)
        lever = positions[bone] - positions[parent]
        velocities[bone] = velocities[parent] + np.cross(spins[parent], lever)


def bone_motion(
    skeleton: Skeleton,
    angles: Floats,
    speeds: Floats,
    positions: Floats,
    rotations: Floats,
    pelvis_velocity: Floats,
    pelvis_spin: Floats,
) -> tuple[Floats, Floats]:
    """Return velocities (m/s) of the origins and angular velocities (rad/s) of all bones.

    Args:
        skeleton: The table.
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
