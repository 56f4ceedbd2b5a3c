"""The skeleton: 47 bones and 82 hinge degrees of freedom. `load_skeleton` reads it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Inertia, Primitive, primitive_inertia


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
    """

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
