"""The skeleton: 47 bones and 82 hinges, read from `data/bones.csv` and `data/dofs.csv`.

The tables are a body of 0.78 m. `load_skeleton` scales them to another size, see `Growth`.

Zero angles are the neutral standing posture: arms hanging, palms to the thighs. The frame of the
pelvis is the base.
"""

from __future__ import annotations

import csv
import functools
import math
import re
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy.growth import REFERENCE, Growth, Scale
from veca_marl.sim.geometry import (
    Floats,
    Inertia,
    Primitive,
    Shape,
    capsule_between,
    primitive_inertia,
)


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
        """Return its mass properties: even density in its first collider with the skin on."""
        return primitive_inertia(self.colliders[0].grown(self.skin_thickness_m), self.mass_kg)


@dataclass(frozen=True)
class Joint:
    """One hinge.

    Attributes:
        bone: Name of the bone that it moves.
        label: Such as `flexion`; unique on its bone.
        axis: Unit vector in the frame of the bone.
        low_rad: Lower limit.
        high_rad: Upper limit.
        torque_nm: Greatest torque.
    """

    bone: str
    label: str
    axis: tuple[float, float, float]
    low_rad: float
    high_rad: float
    torque_nm: float


@dataclass(frozen=True, eq=False)
class Skeleton:
    """All bones and joints, and the same as arrays for compiled loops.

    Two skeletons are equal only if they are the same object, so that a skeleton can be hashed.

    Attributes:
        bones: The 47 bones, parents before their children.
        joints: The 82 joints in the order of their bones.
        parents: ``(47,)`` index of each bone's parent; -1 for the pelvis.
        origins: ``(47, 3)`` metres, joint positions in the parents' frames.
        rest_rotations: ``(47, 3, 3)`` orientations in the parents' frames at zero angles.
        joint_axes: ``(82, 3)`` unit vectors in the frames of the bones.
        joint_slices: ``(47, 2)`` first joint of each bone, and the one after its last.
        growth: Its size.
    """

    bones: tuple[Bone, ...]
    joints: tuple[Joint, ...]
    parents: NDArray[np.int64]
    origins: Floats
    rest_rotations: Floats
    joint_axes: Floats
    joint_slices: NDArray[np.int64]
    growth: Growth = REFERENCE

    @property
    def mass_kg(self) -> float:
        """Mass of the whole body."""
        return sum(bone.mass_kg for bone in self.bones)

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


_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_CAPSULE = re.compile(r"capsule a=\((.+?)\) b=\((.+?)\) r=(\S+)")
_BOX = re.compile(r"box c=\((.+?)\) half=\((.+?)\)")


def load_skeleton(growth: Growth = REFERENCE) -> Skeleton:
    """Return the skeleton of a size, made once per process. It must not be changed."""
    return _skeleton(growth)


@functools.cache
def _skeleton(growth: Growth) -> Skeleton:
    joints = _joints()
    bones = _bones(joints)
    if growth != REFERENCE:
        joints = tuple(_grown_joint(joint, growth.of(joint.bone)) for joint in joints)
        bones = _grown_bones(bones, growth)
    return Skeleton(
        bones=bones,
        joints=joints,
        parents=np.array([bone.parent for bone in bones]),
        origins=np.array([bone.origin for bone in bones]),
        rest_rotations=np.array([bone.rest_rotation for bone in bones]),
        joint_axes=np.array([joint.axis for joint in joints]),
        joint_slices=np.array([(b.first_joint, b.first_joint + b.joint_count) for b in bones]),
        growth=growth,
    )


def _grown_joint(joint: Joint, scale: Scale) -> Joint:
    """Return a joint with the torque of a bone of another volume."""
    return replace(joint, torque_nm=joint.torque_nm * scale.volume)


def _grown_bones(bones: tuple[Bone, ...], growth: Growth) -> tuple[Bone, ...]:
    """Return the bones of another size; they have the mass of the whole body together."""
    volumes = [growth.of(bone.name).volume for bone in bones]
    whole_kg = sum(bone.mass_kg * volume for bone, volume in zip(bones, volumes, strict=True))
    density = 1.0 if growth.mass_kg is None else growth.mass_kg / whole_kg
    return tuple(
        _grown_bone(bone, bones[max(bone.parent, 0)].name, growth, density * bone.mass_kg * volume)
        for bone, volume in zip(bones, volumes, strict=True)
    )


def _grown_bone(bone: Bone, parent: str, growth: Growth, mass_kg: float) -> Bone:
    """Return a bone of another size.

    Its joint lies in the frame of its parent and moves with that. The pressure that presses skin
    down to the bone is that of the table, so that its force follows the area.
    """
    scale = growth.of(bone.name)
    return replace(
        bone,
        origin=_scaled(bone.origin, growth.of(parent)),
        tip=_scaled(bone.tip, scale),
        mass_kg=mass_kg,
        skin_thickness_m=scale.girth * bone.skin_thickness_m,
        skin_force_n=scale.girth**2 * bone.skin_force_n,
        colliders=tuple(_grown_collider(part, scale) for part in bone.colliders),
    )


def _scaled(point: tuple[float, float, float], scale: Scale) -> tuple[float, float, float]:
    return point[0] * scale.x, point[1] * scale.y, point[2] * scale.z


def _grown_collider(part: Primitive, scale: Scale) -> Primitive:
    """Return a collider of another size: a box, or a capsule with another radius."""
    if part.shape is Shape.BOX:
        x, y, z = part.size
        offset = np.asarray(part.offset) * scale.vector
        return Primitive(Shape.BOX, _scaled((x, y, z), scale), offset=offset)
    low, high = (end * scale.vector for end in part.cap_centres())
    return capsule_between(low, high, part.radius * scale.girth)


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
