"""The skin as a mesh: tubes lofted over the bones, exactly 1648 triangles and 894 vertices.

Rings of points in the frames of the bones are joined by bands of triangles and closed by caps. The
rims of thighs and fingers are open; they lie inside pelvis, feet and palms. The right side is the
mirror image of the left. The numbers are our own design, for the body of 0.78 m: that of a body of
another size has each vertex scaled in the frame of its bone, and follows the same bones.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from veca_marl.sim.body.anatomy.growth import REFERENCE, Growth
from veca_marl.sim.body.anatomy.kinematics import forward_kinematics
from veca_marl.sim.body.anatomy.skeleton import Bone, Skeleton, load_skeleton
from veca_marl.sim.geometry import Floats, Mesh, Shape

# rings of each bone: place along the tube's axis, half width along the ring's first and second
# axis, shift of the centre along x (trunk) or z (foot); metres, in the frame of the bone
Ring = tuple[float, float, float, float]
TRUNK: dict[str, tuple[Ring, ...]] = {
    "pelvis": ((-0.035, 0.048, 0.064, 0.0), (0.005, 0.056, 0.078, -0.002), (0.05, 0.056, 0.072, 0)),
    "spine": ((0.042, 0.058, 0.070, 0.002), (0.085, 0.056, 0.071, 0.0)),
    "chest": ((0.045, 0.057, 0.080, 0.0), (0.1, 0.052, 0.074, 0.0), (0.138, 0.030, 0.036, 0.0)),
    "neck": ((0.036, 0.029, 0.030, 0.002),),
    "head": (
        (-0.004, 0.052, 0.047, 0.018),
        (0.030, 0.073, 0.060, 0.012),
        (0.065, 0.081, 0.064, 0.010),
        (0.100, 0.070, 0.055, 0.008),
        (0.124, 0.036, 0.030, 0.008),
    ),
}
ARM: dict[str, tuple[Ring, ...]] = {
    "l_upper_arm": (
        (0.010, 0.026, 0.024, 0.0),
        (-0.030, 0.029, 0.029, 0.0),
        (-0.075, 0.0285, 0.0285, 0.0),
        (-0.118, 0.0245, 0.0245, 0.0),
    ),
    "l_forearm": (
        (-0.030, 0.0245, 0.0240, 0.0),
        (-0.065, 0.0215, 0.0205, 0.0),
        (-0.095, 0.0185, 0.0145, 0.0),
    ),
    "l_hand": (
        (-0.012, 0.0210, 0.0115, 0.0),
        (-0.026, 0.0240, 0.0105, 0.0),
        (-0.040, 0.0250, 0.0100, 0.0),
        (-0.051, 0.0230, 0.0080, 0.0),
    ),
}
LEG: dict[str, tuple[Ring, ...]] = {
    "l_thigh": (
        (0.022, 0.045, 0.043, 0.0),
        (-0.040, 0.044, 0.0435, 0.0),
        (-0.100, 0.040, 0.040, 0.0),
        (-0.155, 0.0325, 0.0315, 0.0),
    ),
    "l_shank": (
        (-0.045, 0.0335, 0.0325, 0.0),
        (-0.090, 0.0265, 0.0260, 0.0),
        (-0.131, 0.0215, 0.0205, 0.0),
    ),
}
FOOT: tuple[Ring, ...] = (
    (-0.026, 0.0190, 0.0195, -0.0215),
    (0.000, 0.0225, 0.0255, -0.0165),
    (0.030, 0.0235, 0.0165, -0.0255),
    (0.060, 0.0255, 0.0115, -0.0305),
    (0.081, 0.0210, 0.0075, -0.0345),
)
FINGERS = {
    **dict.fromkeys(("index", "middle", "ring", "little"), ("proximal", "middle", "distal")),
    "thumb": ("metacarpal", "proximal", "distal"),
}
TRUNK_SECTORS, ARM_SECTORS, LEG_SECTORS, FOOT_SECTORS, FINGER_SECTORS = 12, 8, 10, 9, 6


class Loft:
    """Collects vertices, each in the frame of one bone, and triangles, each of one bone."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self.owners: list[int] = []
        self.points: list[Floats] = []
        self.triangles: list[tuple[int, int, int]] = []
        self.triangle_bones: list[int] = []

    def point(self, bone: str, point: Sequence[float] | Floats) -> int:
        """Add a vertex ``(3,)`` in the frame of a bone, metres; return its number."""
        self.owners.append(self._skeleton.bone(bone))
        self.points.append(np.array(point, float))
        return len(self.points) - 1

    def ring(self, bone: str, points: Floats) -> list[int]:
        """Add vertices ``(n, 3)``; return their numbers."""
        return [self.point(bone, point) for point in points]

    def band(self, bone: str, low: list[int], high: list[int]) -> None:
        """Join two rings that run counter-clockwise about the axis from `low` to `high`.

        The quadrilaterals of the second half are split along the other diagonal: the band of two
        mirror-symmetric rings is mirror-symmetric.
        """
        count = len(low)
        for i in range(count):
            j = (i + 1) % count
            if i < count // 2:
                self._add(bone, (low[i], high[j], high[i]), (low[i], low[j], high[j]))
            else:
                self._add(bone, (low[i], low[j], high[i]), (low[j], high[j], high[i]))

    def cap(self, bone: str, ring: list[int], pole: Sequence[float], above: bool) -> None:
        """Close a ring with a point above or below it."""
        top = self.point(bone, pole)
        for i in range(len(ring)):
            j = (i + 1) % len(ring)
            self._add(bone, (top, ring[i], ring[j]) if above else (top, ring[j], ring[i]))

    def _add(self, bone: str, *triangles: tuple[int, int, int]) -> None:
        self.triangles += triangles
        self.triangle_bones += [self._skeleton.bone(bone)] * len(triangles)

    def mirror(self, first_vertex: int, first_triangle: int) -> None:
        """Append the mirror image of the left side, which begins at these numbers."""
        shift = len(self.points) - first_vertex
        right = {i: self._skeleton.bone("r_" + b.name[2:]) for i, b in _left_bones(self._skeleton)}
        self.owners += [right[owner] for owner in self.owners[first_vertex:]]
        self.points += [point * (1.0, -1.0, 1.0) for point in self.points[first_vertex:]]
        turned = [(a + shift, c + shift, b + shift) for a, b, c in self.triangles[first_triangle:]]
        self.triangles += turned
        self.triangle_bones += [right[bone] for bone in self.triangle_bones[first_triangle:]]


def _left_bones(skeleton: Skeleton) -> list[tuple[int, Bone]]:
    return [(i, bone) for i, bone in enumerate(skeleton.bones) if bone.name.startswith("l_")]


def circle(count: int, phase: float) -> Floats:
    """Points ``(count, 2)`` of a polygon round the unit circle, whose edges touch it."""
    angles = (np.arange(count) + phase) * 2.0 * math.pi / count
    points: Floats = np.stack([np.cos(angles), np.sin(angles)], 1) / math.cos(math.pi / count)
    return points


def horizontal_ring(sectors: int, ring: Ring, phase: float = 0.5) -> Floats:
    """Points ``(sectors, 3)`` of a ring parallel to the xy plane."""
    height, half_x, half_y, shift_x = ring
    x, y = circle(sectors, phase).T
    return np.stack([half_x * x + shift_x, half_y * y, np.full(sectors, height)], 1)


def loft_left_side(loft: Loft, skeleton: Skeleton) -> None:
    """Add the left arm with its fingers and the left leg."""
    _loft_arm(loft)
    for finger in FINGERS:
        _loft_finger(loft, skeleton, finger)
    _loft_limb(loft, LEG, LEG_SECTORS)
    _loft_foot(loft)


def loft_trunk(loft: Loft) -> None:
    """Add pelvis, spine, chest, neck and head."""
    below: list[int] = []
    for bone, rings in TRUNK.items():
        for ring in rings:
            above = loft.ring(bone, horizontal_ring(TRUNK_SECTORS, ring))
            if below:
                loft.band(bone, below, above)
            else:
                loft.cap(bone, above, (0.0, 0.0, -0.055), above=False)
            below = above
    loft.cap("head", below, (0.008, 0.0, 0.135), above=True)


def _loft_limb(loft: Loft, limb: dict[str, tuple[Ring, ...]], sectors: int) -> list[list[int]]:
    """Add a tube from top to bottom; return its first and its last ring."""
    rings: list[list[int]] = []
    for bone, levels in limb.items():
        for level in levels:
            rings.append(loft.ring(bone, horizontal_ring(sectors, level)))
            if len(rings) > 1:
                loft.band(bone, rings[-1], rings[-2])
    return [rings[0], rings[-1]]


def _loft_arm(loft: Loft) -> None:
    first, last = _loft_limb(loft, ARM, ARM_SECTORS)
    loft.cap("l_upper_arm", first, (0.0, 0.0, 0.026), above=True)
    loft.cap("l_hand", last, (0.0, 0.0, -0.0545), above=False)


def _loft_foot(loft: Loft) -> None:
    behind: list[int] = []
    for x, half_y, half_z, z in FOOT:
        y_unit, z_unit = circle(FOOT_SECTORS, 0.25).T
        # the sole is flat: its lowest points are at the height of the ring
        flat = half_z * math.cos(math.pi / FOOT_SECTORS)
        points = np.stack([np.full(FOOT_SECTORS, x), half_y * y_unit, flat * z_unit + z], 1)
        ahead = loft.ring("l_foot", points)
        if behind:
            loft.band("l_foot", behind, ahead)
        else:
            loft.cap("l_foot", ahead, (-0.032, 0.0, -0.026), above=False)
        behind = ahead
    loft.cap("l_foot", behind, (0.088, 0.0, -0.0345), above=True)


def _loft_finger(loft: Loft, skeleton: Skeleton, finger: str) -> None:
    """Add a tube of the thickness of the bones and their skin, tapering to the tip."""
    limb: dict[str, tuple[Ring, ...]] = {}
    length = 0.0
    for place, part in enumerate(FINGERS[finger]):
        name = f"l_{finger}_{part}"
        bone = skeleton.bones[skeleton.bone(name)]
        radius, length = bone.colliders[0].radius + bone.skin_thickness_m, -bone.tip[2]
        base = 0.0 if finger == "thumb" else 0.001
        shapes = (
            ((base, 1.0), (-length / 2.0, 1.0), (-length, 0.97)),
            ((-length, 0.97),),
            ((-0.70 * length, 0.95),),
        )[place]
        limb[name] = tuple((z, radius * share, radius * share, 0.0) for z, share in shapes)
    _, last = _loft_limb(loft, limb, FINGER_SECTORS)
    loft.cap(list(limb)[-1], last, (0.0, 0.0, -length), above=False)


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


def bind(skeleton: Skeleton, loft: Loft, growth: Growth = REFERENCE) -> Mesh:
    """Return the mesh of a loft, grey, its triangles sorted by bone.

    Args:
        skeleton: The table of bones, in whose size the loft is.
        loft: The surface.
        growth: The size of the mesh.
    """
    positions, rotations = binding_pose(load_skeleton(growth))
    owners = np.array(loft.owners)
    scales = np.array([growth.of(bone.name).vector for bone in skeleton.bones])
    points = np.array(loft.points) * scales[owners]
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


def load_skin(growth: Growth = REFERENCE) -> Mesh:
    """Return the skin of a size, grey, its triangles sorted by bone (made once per process)."""
    return _skin(growth)


@functools.cache
def _skin(growth: Growth) -> Mesh:
    skeleton = load_skeleton()
    loft = Loft(skeleton)
    loft_trunk(loft)
    first_vertex, first_triangle = len(loft.points), len(loft.triangles)
    loft_left_side(loft, skeleton)
    loft.mirror(first_vertex, first_triangle)
    return bind(skeleton, loft, growth)
