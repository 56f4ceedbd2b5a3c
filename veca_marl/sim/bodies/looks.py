"""The bones of a body as primitives to draw: bone colliders with their skin on, in clothes."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.bodies.mounts import EYES, ORGANS_M
from veca_marl.sim.pose import Floats
from veca_marl.sim.scene import Geom, Shape
from veca_marl.sim.skeleton import Bone, BoneBox, BoneCapsule, Skeleton

SKIN = (0.93, 0.74, 0.62)
TROUSERS = (0.25, 0.28, 0.40)
SHOES = (0.30, 0.20, 0.15)
PUPILS = (0.10, 0.08, 0.08)
SHIRTS = ((0.20, 0.40, 0.90), (0.90, 0.30, 0.20), (0.20, 0.75, 0.30), (0.90, 0.80, 0.20))

_CLOTHED = {"spine": "shirt", "chest": "shirt", "upper_arm": "shirt"}
_CLOTHED |= {"pelvis": "trousers", "thigh": "trousers", "shank": "trousers", "foot": "shoes"}


def bone_geoms(skeleton: Skeleton, shirt: tuple[float, float, float]) -> list[list[Geom]]:
    """Return the primitives on each of the 47 frames of a body."""
    colours = {"shirt": shirt, "trousers": TROUSERS, "shoes": SHOES}
    frames = [
        [_geom(part, bone, colours.get(_CLOTHED.get(_part_name(bone), ""), SKIN)) for part in parts]
        for bone, parts in ((bone, bone.colliders) for bone in skeleton.bones)
    ]
    # eyes, so that others see where it looks
    frames[skeleton.bone("head")] += [
        Geom(Shape.SPHERE, (0.012,), PUPILS, offset=ORGANS_M[eye]) for eye in EYES
    ]
    return frames


def _part_name(bone: Bone) -> str:
    return bone.name.removeprefix("l_").removeprefix("r_")


def _geom(part: BoneCapsule | BoneBox, bone: Bone, colour: tuple[float, float, float]) -> Geom:
    skin = bone.skin_thickness_m
    if isinstance(part, BoneBox):
        x, y, z = (half + skin for half in part.half)
        return Geom(Shape.BOX, (x, y, z), colour, offset=part.centre)
    start, end = np.array(part.start), np.array(part.end)
    length = float(np.linalg.norm(end - start))
    size = (part.radius + skin, length)
    return Geom(Shape.CAPSULE, size, colour, (start + end) / 2, _along((end - start) / length))


def _along(axis: Floats) -> Floats:
    """Return a rotation whose z axis is `axis`."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
