"""The skeleton: 47 bones and 82 hinge degrees of freedom as a table, and its forward kinematics.

The table is `data/bones.csv` and `data/dofs.csv`: a child of 0.78 m and 10 kg. Zero angles are the
neutral-zero standing posture, arms hanging, palms to the thighs; the pelvis frame is the base.
"""

from __future__ import annotations

import csv
import functools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import (
    Floats,
    Inertia,
    Primitive,
    Shape,
    capsule_between,
    primitive_inertia,
)

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_CAPSULE = re.compile(r"capsule a=\((.+?)\) b=\((.+?)\) r=(\S+)")
_BOX = re.compile(r"box c=\((.+?)\) half=\((.+?)\)")


@dataclass(frozen=True)
class Bone:
    """One rigid bone.

    Attributes:
        name: Such as `l_upper_arm`.
        parent: Index of the parent bone; -1 for the pelvis.
        origin: Joint position in the parent's frame, metres.
        rest_rotation: ``(3, 3)`` orientation in the parent's frame at zero angles.
        tip: Far end of the segment in its own frame, metres.
        mass_kg: Mass of the segment.
        skin_thickness_m: Flexible skin over the bone (``d_max`` of the tactile sense).
        skin_force_n: Force on one contact point that presses the skin down to the bone.
        colliders: The rigid bone as primitives in its own frame.
        first_joint: Index of its first degree of freedom.
        joint_count: Number of its degrees of freedom, 0 to 3.
    """

    name: str
    parent: int
    origin: tuple[float, float, float]
    rest_rotation: Floats
    tip: tuple[float, float, float]
    mass_kg: float
    skin_thickness_m: float
    skin_force_n: float
    colliders: tuple[Primitive, ...]
    first_joint: int
    joint_count: int

    def inertia(self) -> Inertia:
        """Return its mass properties: the mass fills its first collider with the skin evenly."""
        return primitive_inertia(self.colliders[0].grown(self.skin_thickness_m), self.mass_kg)


@dataclass(frozen=True)
class Joint:
    """One hinge: its bone, label, unit axis in the bone's frame, limits (rad) and torque (N m)."""

    bone: str
    label: str
    axis: tuple[float, float, float]
    low_rad: float
    high_rad: float
    torque_nm: float


@dataclass(frozen=True)
class Skeleton:
    """The table and, beside it, the arrays that forward kinematics loops over."""

    bones: tuple[Bone, ...]
    joints: tuple[Joint, ...]
    parents: NDArray[np.int64]
    origins: Floats
    rest_rotations: Floats
    joint_axes: Floats
    joint_slices: NDArray[np.int64]

    def bone(self, name: str) -> int:
        """Return the index of a bone; raise `KeyError` with the names that exist."""
        for index, bone in enumerate(self.bones):
            if bone.name == name:
                return index
        raise KeyError(f"no bone {name!r}; there are {[b.name for b in self.bones]}")

    def joint(self, bone: str, label: str) -> int:
        """Return the index of a degree of freedom, such as `("head", "rotation")`."""
        for index, joint in enumerate(self.joints):
            if (joint.bone, joint.label) == (bone, label):
                return index
        names = [f"{j.bone}.{j.label}" for j in self.joints]
        raise KeyError(f"no joint {bone}.{label}; there are {names}")


def _vector(text: str) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in text.split())
    return x, y, z


def _axis(text: str) -> tuple[float, float, float]:
    sign = -1.0 if text[0] == "-" else 1.0
    x, y, z = _AXES[text[1]]
    return sign * x, sign * y, sign * z


def _rotation(roll: float, pitch: float, yaw: float) -> Floats:
    """Return Rz(yaw) Ry(pitch) Rx(roll), angles in radians (the URDF convention)."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _colliders(text: str) -> tuple[Primitive, ...]:
    parts: list[Primitive] = []
    for part in text.split(" + "):
        if capsule := _CAPSULE.fullmatch(part):
            start, end, radius = capsule.groups()
            parts.append(capsule_between(_vector(start), _vector(end), float(radius)))
        elif box := _BOX.fullmatch(part):
            centre, half = box.groups()
            parts.append(Primitive(Shape.BOX, _vector(half), offset=_vector(centre)))
        else:
            raise ValueError(f"bones.csv: cannot read the collider {part!r}")
    return tuple(parts)


def _rows(name: str) -> list[dict[str, str]]:
    with (files("veca_marl") / "data" / name).open(encoding="utf-8") as table:
        return list(csv.DictReader(table))


def _joints() -> tuple[Joint, ...]:
    return tuple(
        Joint(
            row["bone"],
            row["label"],
            _axis(row["axis_in_bone_parent_frame"]),
            math.radians(float(row["lo_deg"])),
            math.radians(float(row["hi_deg"])),
            float(row["tau_Nm"]),
        )
        for row in _rows("dofs.csv")
    )


def limit_sources() -> list[tuple[str, str]]:
    """Return the sources of each joint's lower and upper limit (``docs/reference/body.md``)."""
    return [(row["lo_from"], row["hi_from"]) for row in _rows("dofs.csv")]


def _bones(joints: tuple[Joint, ...]) -> tuple[Bone, ...]:
    bones: list[Bone] = []
    names: dict[str, int] = {"": -1}
    for row in _rows("bones.csv"):
        name = row["bone"]
        own = [index for index, joint in enumerate(joints) if joint.bone == name]
        angles = (math.radians(float(row[f"rest_{a}_deg"])) for a in ("roll", "pitch", "yaw"))
        bones.append(
            Bone(
                name=name,
                parent=names[row["parent"]],
                origin=(float(row["origin_x"]), float(row["origin_y"]), float(row["origin_z"])),
                rest_rotation=_rotation(*angles),
                tip=(float(row["tip_x"]), float(row["tip_y"]), float(row["tip_z"])),
                mass_kg=float(row["mass_kg"]),
                skin_thickness_m=float(row["d_max_mm"]) / 1000.0,
                skin_force_n=float(row["skin_force_to_bone_N"]),
                colliders=_colliders(row["bone_colliders"]),
                first_joint=own[0] if own else 0,
                joint_count=len(own),
            )
        )
        names[name] = len(bones) - 1
    return tuple(bones)


@functools.cache
def load_skeleton() -> Skeleton:
    """Read the table (once per process; the result is read-only)."""
    joints = _joints()
    bones = _bones(joints)
    return Skeleton(
        bones=bones,
        joints=joints,
        parents=np.array([bone.parent for bone in bones]),
        origins=np.array([bone.origin for bone in bones]),
        rest_rotations=np.array([bone.rest_rotation for bone in bones]),
        joint_axes=np.array([joint.axis for joint in joints]),
        joint_slices=np.array([(b.first_joint, b.first_joint + b.joint_count) for b in bones]),
    )


class Underside:
    """The lowest point of some bones: corners of boxes and cap centres of capsules.

    Args:
        skeleton: The table.
        bones: Which bones count.
        skin: Whether with the flexible skin or the rigid bones alone.
    """

    def __init__(self, skeleton: Skeleton, bones: Sequence[str], skin: bool) -> None:
        points: list[tuple[int, Floats, float]] = []
        for name in bones:
            frame = skeleton.bone(name)
            grown = skeleton.bones[frame].skin_thickness_m if skin else 0.0
            for part in skeleton.bones[frame].colliders:
                points += [(frame, at, radius + grown) for at, radius in _extremes(part)]
        self._frames = np.array([frame for frame, _, _ in points])
        self._offsets = np.array([offset for _, offset, _ in points])
        self._radii = np.array([radius for _, _, radius in points])

    def lowest_m(self, positions: Floats, rotations: Floats) -> float:
        """Return the height of the lowest point.

        Args:
            positions: ``(47, 3)`` bone origins, metres.
            rotations: ``(47, 3, 3)`` bone rotations.
        """
        up = rotations[self._frames, 2]
        heights = positions[self._frames, 2] + (up * self._offsets).sum(axis=1) - self._radii
        return float(heights.min())


class Soles(Underside):
    """The undersides of both feet.

    The rigid bones stand on the floor; their flexible skin is pressed flat beneath them.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        super().__init__(skeleton, ("l_foot", "r_foot"), skin=False)


def _extremes(part: Primitive) -> list[tuple[Floats, float]]:
    """Return points and the radius of the ball round each, which together span a primitive."""
    if part.shape is not Shape.BOX:
        return [(centre, part.radius) for centre in part.cap_centres()]
    return [(corner, 0.0) for corner in part.corners()]


@njit(cache=True)
def turn(rotation: Floats, axis: Floats, angle: float, out: Floats) -> None:
    """Write rotation @ Rodrigues(axis, angle) to out, which may be `rotation` itself."""
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
    """Fill rows 1.. of positions and rotations; row 0 (the pelvis) is given."""
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
            turn(rotations[bone], joint_axes[joint], angles[joint], rotations[bone])


def forward_kinematics(
    skeleton: Skeleton, angles: Floats, positions: Floats, rotations: Floats
) -> None:
    """Pose all bones below the pelvis.

    Args:
        skeleton: The table.
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
