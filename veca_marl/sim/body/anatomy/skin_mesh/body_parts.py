"""The lofts of trunk, limbs and fingers, on the left side of the body."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.body.anatomy.skin_mesh.loft import Loft, circle, horizontal_ring
from veca_marl.sim.body.anatomy.skin_mesh.profiles import (
    ARM,
    ARM_SECTORS,
    FINGER_SECTORS,
    FINGERS,
    FOOT,
    FOOT_SECTORS,
    LEG,
    LEG_SECTORS,
    TRUNK,
    TRUNK_SECTORS,
    Ring,
)


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
