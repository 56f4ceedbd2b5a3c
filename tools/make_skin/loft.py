"""The mesh before the fit: tubes lofted over the bones, 1648 triangles and 894 vertices.

Rings of points in the frames of the bones are joined by bands of triangles and closed by caps. The
rims of thighs, shanks and fingers are open; they lie inside pelvis, feet and palms. The right side
is the mirror image of the left. A tube passes from one bone to the next near the crease in which
the skins of both meet, so that a taxel lies over the bone that it belongs to.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton
from veca_marl.sim.geometry import Floats

# rings of each bone: place along the tube's axis, half width along the ring's first and second
# axis, shift of the centre along x (trunk) or z (foot); metres, in the frame of the bone
Ring = tuple[float, float, float, float]
TrunkRing = tuple[float, float, float, float, float]  # the last is how much higher its sides are
TRUNK: dict[str, tuple[TrunkRing, ...]] = {
    "pelvis": (
        (-0.043, 0.027, 0.048, -0.002, 0.0),
        (-0.010, 0.046, 0.074, -0.004, 0.0),
        (0.050, 0.050, 0.070, -0.003, 0.0),
    ),
    "spine": ((0.042, 0.056, 0.074, 0.0, 0.0), (0.090, 0.053, 0.073, 0.0, 0.0)),
    "chest": (
        (0.055, 0.056, 0.080, 0.0, 0.0),
        (0.092, 0.038, 0.065, 0.0, 0.028),
        (0.122, 0.029, 0.032, 0.0, 0.014),
    ),
    "neck": ((0.040, 0.029, 0.029, 0.0, 0.006),),
    "head": (
        (0.027, 0.064, 0.050, 0.010, 0.0),
        (0.053, 0.076, 0.062, 0.010, 0.0),
        (0.081, 0.076, 0.062, 0.010, 0.0),
        (0.106, 0.064, 0.050, 0.010, 0.0),
        (0.124, 0.042, 0.028, 0.010, 0.0),
    ),
}
ARM: dict[str, tuple[Ring, ...]] = {
    "l_upper_arm": (
        (0.010, 0.025, 0.024, 0.0),
        (-0.030, 0.028, 0.028, 0.0),
        (-0.085, 0.028, 0.028, 0.0),
        (-0.127, 0.020, 0.020, 0.0),
    ),
    "l_forearm": (
        (-0.035, 0.019, 0.019, 0.0),
        (-0.070, 0.019, 0.019, 0.0),
        (-0.098, 0.0185, 0.0130, 0.0),
    ),
    "l_hand": (
        (-0.014, 0.0220, 0.0105, 0.0),
        (-0.026, 0.0225, 0.0100, 0.0),
        (-0.040, 0.0225, 0.0100, 0.0),
        (-0.049, 0.0210, 0.0085, 0.0),
    ),
}
LEG: dict[str, tuple[Ring, ...]] = {
    "l_thigh": (
        (0.018, 0.018, 0.018, 0.0),
        (-0.038, 0.042, 0.042, 0.0),
        (-0.108, 0.042, 0.042, 0.0),
        (-0.172, 0.027, 0.027, 0.0),
    ),
    "l_shank": (
        (-0.070, 0.025, 0.025, 0.0),
        (-0.130, 0.025, 0.025, 0.0),
        (-0.157, 0.0155, 0.0155, 0.0),
    ),
}
FOOT: tuple[Ring, ...] = (
    (-0.018, 0.0170, 0.0120, -0.0275),
    (0.005, 0.0190, 0.0140, -0.0275),
    (0.035, 0.0190, 0.0140, -0.0275),
    (0.061, 0.0190, 0.0120, -0.0295),
    (0.072, 0.0180, 0.0080, -0.0345),
)
FINGERS = {
    **dict.fromkeys(("index", "middle", "ring", "little"), ("proximal", "middle", "distal")),
    "thumb": ("metacarpal", "proximal", "distal"),
}
TRUNK_SECTORS, ARM_SECTORS, LEG_SECTORS, FOOT_SECTORS, FINGER_SECTORS = 12, 8, 10, 9, 6


class Loft:
    """Collects vertices, each in the frame of one bone, and triangles, each of one bone.

    Attributes:
        owners: Bone of each vertex.
        points: ``(3,)`` metres in the frame of that bone, for each vertex.
        triangles: Three vertices each, counter-clockwise as seen from outside.
        triangle_bones: Bone of each triangle.
        first_left: First vertex of the left side; those before it are of the trunk.
        first_right: First vertex of the right side, in the order of the left one.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self.owners: list[int] = []
        self.points: list[Floats] = []
        self.triangles: list[tuple[int, int, int]] = []
        self.triangle_bones: list[int] = []
        self.first_left = self.first_right = 0

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

    def mirror(self, first_triangle: int) -> None:
        """Append the mirror image of the left side, which begins with this triangle."""
        self.first_right = len(self.points)
        bones = enumerate(self._skeleton.bones)
        right = {
            i: self._skeleton.bone("r_" + bone.name[2:])
            for i, bone in bones
            if bone.name.startswith("l_")
        }
        shift = self.first_right - self.first_left
        self.owners += [right[owner] for owner in self.owners[self.first_left :]]
        self.points += [point * (1.0, -1.0, 1.0) for point in self.points[self.first_left :]]
        turned = [(a + shift, c + shift, b + shift) for a, b, c in self.triangles[first_triangle:]]
        self.triangles += turned
        self.triangle_bones += [right[bone] for bone in self.triangle_bones[first_triangle:]]


def lofted(skeleton: Skeleton) -> Loft:
    """Return the loft of the whole body."""
    loft = Loft(skeleton)
    _loft_trunk(loft)
    loft.first_left, first_triangle = len(loft.points), len(loft.triangles)
    _loft_arm(loft)
    for finger in FINGERS:
        _loft_finger(loft, skeleton, finger)
    _loft_limb(loft, LEG, LEG_SECTORS)
    _loft_foot(loft)
    loft.mirror(first_triangle)
    return loft


def _circle(count: int, phase: float) -> Floats:
    """Vertices ``(count, 2)`` of the regular polygon that circumscribes the unit circle."""
    angles = (np.arange(count) + phase) * 2.0 * math.pi / count
    points: Floats = np.stack([np.cos(angles), np.sin(angles)], 1) / math.cos(math.pi / count)
    return points


def _horizontal_ring(sectors: int, ring: Ring, phase: float = 0.5) -> Floats:
    """Points ``(sectors, 3)`` of a ring parallel to the xy plane."""
    height, half_x, half_y, shift_x = ring
    x, y = _circle(sectors, phase).T
    return np.stack([half_x * x + shift_x, half_y * y, np.full(sectors, height)], 1)


def _loft_trunk(loft: Loft) -> None:
    below: list[int] = []
    for bone, rings in TRUNK.items():
        for ring in rings:
            points = _horizontal_ring(TRUNK_SECTORS, ring[:4])
            points[:, 2] += ring[4] * (points[:, 1] / points[:, 1].max()) ** 2
            above = loft.ring(bone, points)
            if below:
                loft.band(bone, below, above)
            else:
                loft.cap(bone, above, (-0.002, 0.0, -0.056), above=False)
            below = above
    loft.cap("head", below, (0.010, 0.0, 0.130), above=True)


def _loft_limb(loft: Loft, limb: dict[str, tuple[Ring, ...]], sectors: int) -> list[list[int]]:
    """Add a tube from top to bottom; return its first and its last ring."""
    rings: list[list[int]] = []
    for bone, levels in limb.items():
        for level in levels:
            rings.append(loft.ring(bone, _horizontal_ring(sectors, level)))
            if len(rings) > 1:
                loft.band(bone, rings[-1], rings[-2])
    return [rings[0], rings[-1]]


def _loft_arm(loft: Loft) -> None:
    first, last = _loft_limb(loft, ARM, ARM_SECTORS)
    loft.cap("l_upper_arm", first, (0.0, 0.0, 0.024), above=True)
    loft.cap("l_hand", last, (0.0, 0.0, -0.0505), above=False)


def _loft_foot(loft: Loft) -> None:
    behind: list[int] = []
    for x, half_y, half_z, z in FOOT:
        y_unit, z_unit = _circle(FOOT_SECTORS, 0.25).T
        # the sole is flat: its lowest points are at the height of the ring
        flat = half_z * math.cos(math.pi / FOOT_SECTORS)
        points = np.stack([np.full(FOOT_SECTORS, x), half_y * y_unit, flat * z_unit + z], 1)
        ahead = loft.ring("l_foot", points)
        if behind:
            loft.band("l_foot", behind, ahead)
        else:
            loft.cap("l_foot", ahead, (-0.0235, 0.0, -0.0275), above=False)
        behind = ahead
    loft.cap("l_foot", behind, (0.0765, 0.0, -0.0345), above=True)


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
