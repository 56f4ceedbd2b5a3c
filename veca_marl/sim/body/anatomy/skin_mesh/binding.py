"""Binding of the skin to the bones: which two bones each vertex follows, with which weights."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body.anatomy.kinematics import forward_kinematics
from veca_marl.sim.body.anatomy.skeleton import Bone, Skeleton
from veca_marl.sim.body.anatomy.skin_mesh.loft import Loft
from veca_marl.sim.geometry import Floats, Mesh, Shape

GREY = (0.7, 0.7, 0.7)

# limbs are bound in an A-pose, half way between hanging and raised, where distortion is least
_BINDING = {"upper_arm": math.radians(25.0), "thigh": math.radians(5.0)}

# a vertex follows both bones within this share of the shorter one on either side of their joint
_BEND_SHARE = 0.35
# where a limb leaves the trunk, or a finger the palm, metres on either side of the joint
_BRANCH_ZONE_M, _KNUCKLE_ZONE_M = 0.030, 0.006


def binding_pose(skeleton: Skeleton) -> tuple[Floats, Floats]:
    """Return the binding pose: positions ``(47, 3)`` and rotations ``(47, 3, 3)`` of the bones."""
    angles = np.zeros(len(skeleton.joints))
    for part, angle in _BINDING.items():
        for side in "lr":
            angles[skeleton.joint(f"{side}_{part}", "abduction")] = angle
    positions, rotations = np.zeros((len(skeleton.bones), 3)), np.tile(np.eye(3), (47, 1, 1))
    forward_kinematics(skeleton, angles, positions, rotations)
    return positions, rotations


def _smoothstep(share: float) -> float:
    t = min(max(share, 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def _length_m(bone: Bone) -> float:
    return max(float(np.linalg.norm(bone.tip)), 0.01)


def _continues(parent: Bone, child: Bone) -> bool:
    """Whether a bone begins where its parent ends, rather than branching off."""
    return bool(np.allclose(parent.tip, child.origin, atol=1e-9))


def _zone_above_m(skeleton: Skeleton, bone: Bone) -> float:
    """Half width of the zone in which the skin of a bone also follows its parent."""
    parent = skeleton.bones[bone.parent]
    if _continues(parent, bone):
        return _BEND_SHARE * min(_length_m(bone), _length_m(parent))
    return _KNUCKLE_ZONE_M if parent.colliders[0].shape is Shape.BOX else _BRANCH_ZONE_M


def _follows(skeleton: Skeleton, owner: int, point: Floats) -> tuple[int, float]:
    """Return the second bone that a vertex of `owner` follows, and its weight."""
    bone = skeleton.bones[owner]
    along = float(point @ np.array(bone.tip) / np.linalg.norm(bone.tip))
    if bone.parent >= 0:
        zone = _zone_above_m(skeleton, bone)
        share = 1.0 - _smoothstep((along + zone) / (2.0 * zone))
        if share > 0.0:
            return bone.parent, share
    for index, child in enumerate(skeleton.bones):
        if child.parent == owner and _continues(bone, child):
            zone = _BEND_SHARE * min(_length_m(bone), _length_m(child))
            share = _smoothstep((along - _length_m(bone) + zone) / (2.0 * zone))
            return index, share
    return owner, 0.0


def bind(skeleton: Skeleton, loft: Loft) -> Mesh:
    """Return the mesh of a loft, grey, its triangles sorted by bone."""
    positions, rotations = binding_pose(skeleton)
    owners, points = np.array(loft.owners), np.array(loft.points)
    others = [_follows(skeleton, o, p) for o, p in zip(loft.owners, loft.points, strict=True)]
    frames = np.stack([owners, [bone for bone, _ in others]], axis=1)
    share = np.array([share for _, share in others])
    world = positions[owners] + np.einsum("vij,vj->vi", rotations[owners], points)
    offsets = np.einsum("vkji,vkj->vki", rotations[frames], world[:, None] - positions[frames])
    order = np.argsort(loft.triangle_bones, kind="stable")
    return Mesh(
        frames=frames,
        weights=np.stack([1.0 - share, share], axis=1),
        offsets=np.ascontiguousarray(offsets),
        triangles=np.array(loft.triangles)[order],
        owners=np.array(loft.triangle_bones)[order],
        colours=np.tile(np.array(GREY, np.float32), (len(order), 1)),
    )
