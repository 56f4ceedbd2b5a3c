"""Forward kinematics of the skeleton: positions, velocities and lowest points of its bones."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.geometry import Floats, Primitive, Shape
from veca_marl.sim.kernels import compiled, inlined, kernel


@kernel
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


@kernel
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


@compiled
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


@inlined
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


class Underside:
    """The lowest point of some bones: of the corners of boxes and of the caps of capsules.

    Args:
        skeleton: The skeleton.
        bones: Names of the bones.
        skin: Whether their flexible skin counts, or the rigid bones alone.

    Attributes:
        frames: ``(n,)`` bones of the balls that have the hulls of all bones.
        offsets: ``(n, 3)`` metres, their centres in the frames of the bones.
        radii: ``(n,)`` metres.
    """

    def __init__(self, skeleton: Skeleton, bones: Sequence[str], skin: bool) -> None:
        points: list[tuple[int, Floats, float]] = []
        for name in bones:
            frame = skeleton.bone(name)
            skin_m = skeleton.bones[frame].skin_thickness_m if skin else 0.0
            for part in skeleton.bones[frame].colliders:
                points += [(frame, at, radius + skin_m) for at, radius in _extremes(part)]
        self.frames = np.array([frame for frame, _, _ in points])
        self.offsets = np.array([offset for _, offset, _ in points])
        self.radii = np.array([radius for _, _, radius in points])

    def lowest_m(self, positions: Floats, rotations: Floats) -> float:
        """Return the height of the lowest point.

        Args:
            positions: ``(47, 3)`` bone origins, metres.
            rotations: ``(47, 3, 3)`` bone rotations.
        """
        return float(_lowest_m(self.frames, self.offsets, self.radii, positions, rotations))

    def put_on(self, surface_m: float, positions: Floats, rotations: Floats) -> None:
        """Shift all bones vertically, so that the lowest point is at the height of a surface.

        Args:
            surface_m: Height of the surface.
            positions: ``(47, 3)`` bone origins, metres; the heights are changed.
            rotations: ``(47, 3, 3)`` bone rotations.
        """
        _put_on(surface_m, self.frames, self.offsets, self.radii, positions, rotations)


@kernel
def _lowest_m(
    frames: NDArray[np.int64], offsets: Floats, radii: Floats, positions: Floats, rotations: Floats
) -> float:
    """Return the height of the lowest of some balls.

    Args:
        frames: ``(n,)`` bones of the balls.
        offsets: ``(n, 3)`` metres, their centres in the frames of the bones.
        radii: ``(n,)`` metres.
        positions: ``(47, 3)`` bone origins, metres.
        rotations: ``(47, 3, 3)`` bone rotations.
    """
    lowest = math.inf
    for n in range(len(frames)):
        up, at = rotations[frames[n], 2], offsets[n]
        along = up[0] * at[0] + up[1] * at[1] + up[2] * at[2]
        lowest = min(lowest, positions[frames[n], 2] + along - radii[n])
    return lowest


@kernel
def _put_on(
    surface_m: float,
    frames: NDArray[np.int64],
    offsets: Floats,
    radii: Floats,
    positions: Floats,
    rotations: Floats,
) -> None:
    """Shift all bones vertically, see `Underside.put_on` and `_lowest_m`."""
    down_m = _lowest_m(frames, offsets, radii, positions, rotations) - surface_m
    for bone in range(len(positions)):
        positions[bone, 2] -= down_m


class Soles(Underside):
    """The undersides of both feet, without skin: the skin is compressed by the body's weight."""

    def __init__(self, skeleton: Skeleton) -> None:
        super().__init__(skeleton, ("l_foot", "r_foot"), skin=False)


def _extremes(part: Primitive) -> list[tuple[Floats, float]]:
    """Return points and the radius of the ball at each, which have the hull of the primitive."""
    if part.shape is not Shape.BOX:
        return [(centre, part.radius) for centre in part.cap_centres()]
    return [(corner, 0.0) for corner in part.corners()]
