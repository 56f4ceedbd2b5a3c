"""The skin as a mesh, exactly 1648 triangles and 894 vertices, read from `data/skin_*.csv`.

The mesh is fitted to the felt skin, the surface of the bones' primitives with the skin on: in the
binding pose their distance is at most 2 mm at all taxels that are not inside another limb
(``python -m tools.make_skin`` in a checkout). The rims of thighs, shanks and fingers are open; they
lie inside pelvis, feet and palms. The right side is the mirror image of the left. The table is for
the body of 0.78 m: that of a body of another size has each vertex scaled in the frame of its bone,
and follows the same bones.
"""

from __future__ import annotations

import csv
import functools
import math
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy.growth import REFERENCE, Growth
from veca_marl.sim.body.anatomy.kinematics import forward_kinematics
from veca_marl.sim.body.anatomy.skeleton import Bone, Skeleton, load_skeleton
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


def load_skin(growth: Growth = REFERENCE) -> Mesh:
    """Return the skin of a size, grey, its triangles sorted by bone (made once per process)."""
    return _skin(growth)


@functools.cache
def _skin(growth: Growth) -> Mesh:
    table = load_skeleton()
    owners, points = _table("skin_vertices.csv", table)
    triangle_bones, triangles = _table("skin_triangles.csv", table)
    scales = np.array([growth.of(bone.name).vector for bone in table.bones])
    follows = [_follows(table, *vertex) for vertex in zip(owners.tolist(), points, strict=True)]
    frames = np.stack([owners, [bone for bone, _ in follows]], axis=1)
    share = np.array([share for _, share in follows])
    return Mesh(
        frames=frames,
        weights=np.stack([1.0 - share, share], axis=1),
        offsets=_offsets(frames, points * scales[owners], load_skeleton(growth)),
        triangles=triangles.astype(np.int64),
        owners=triangle_bones,
        colours=np.tile(np.array(GREY, np.float32), (len(triangles), 1)),
    )


def _offsets(frames: NDArray[np.int64], points: Floats, skeleton: Skeleton) -> Floats:
    """Return where vertices are in the frames of both bones that they follow.

    Args:
        frames: ``(V, 2)`` bones.
        points: ``(V, 3)`` metres in the frame of the first one.
        skeleton: In the size of the points.

    Returns:
        ``(V, 2, 3)`` metres, of the binding pose.
    """
    positions, rotations = binding_pose(skeleton)
    first = frames[:, 0]
    world = positions[first] + np.einsum("vij,vj->vi", rotations[first], points)
    offsets = np.einsum("vkji,vkj->vki", rotations[frames], world[:, None] - positions[frames])
    return np.ascontiguousarray(offsets)


def _table(name: str, skeleton: Skeleton) -> tuple[NDArray[np.int64], Floats]:
    """Return the bones ``(n,)`` and the three numbers ``(n, 3)`` of the rows of a table."""
    with (files("veca_marl") / "data" / name).open(encoding="utf-8") as table:
        _, *rows = csv.reader(table)
    bones = {bone.name: index for index, bone in enumerate(skeleton.bones)}
    numbers = np.array([row[1:] for row in rows]).astype(float)
    return np.array([bones[row[0]] for row in rows]), numbers
