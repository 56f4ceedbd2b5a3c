"""The appearance of a body: a skin mesh with clothes and hair, and the eyes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body.anatomy import Bone, Skeleton, load_skin
from veca_marl.sim.body.sense_organs import EYES, MOUNTS_M
from veca_marl.sim.geometry import Geom, Mesh, Primitive, Shape

SKIN = (0.93, 0.74, 0.62)
TROUSERS = (0.25, 0.28, 0.40)
SHOES = (0.30, 0.20, 0.15)
HAIR = (0.35, 0.22, 0.12)
PUPILS = (0.10, 0.08, 0.08)
SHIRTS = ((0.20, 0.40, 0.90), (0.90, 0.30, 0.20), (0.20, 0.75, 0.30), (0.90, 0.80, 0.20))

_CLOTHED = {"spine": "shirt", "chest": "shirt", "upper_arm": "shirt"}
_CLOTHED |= {"pelvis": "trousers", "thigh": "trousers", "shank": "trousers", "foot": "shoes"}
_PUPIL_M = 0.012  # radius of what is drawn
# the open rims of the mesh come out of the pelvis in a step
_LINED = ("l_thigh", "r_thigh")
_LINING_M = 0.003  # below the surface of the skin, outside of which it is not seen
# hair is behind and above this plane in the head's frame: n . x = d, metres
_HAIRLINE_NORMAL, _HAIRLINE_M = np.array([-0.6, 0.0, 0.8]), 0.048


def dressed_skin(skeleton: Skeleton, shirt: tuple[float, float, float]) -> Mesh:
    """Return the skin mesh with the colours of clothes and hair."""
    mesh = load_skin(skeleton.growth)
    by_bone = np.array([_colour(bone, shirt) for bone in skeleton.bones], np.float32)
    colours = by_bone[mesh.owners]
    colours[_hairy(mesh, skeleton.bone("head"), skeleton.growth.head_size)] = HAIR
    return replace(mesh, colours=colours)


def bone_geoms(skeleton: Skeleton, shirt: tuple[float, float, float]) -> list[list[Geom]]:
    """Return the primitives on each of the 47 frames of a body.

    The primitives of the bones, with their flexible skin, are for touch and for shadows; they are
    invisible, and the skin mesh is drawn in their place. The pupils are drawn as spheres, and the
    thighs once more below their skin: nobody looks through the gap between the mesh's thighs and
    its pelvis.
    """
    frames = [
        [_geom(part, bone, _colour(bone, shirt)) for part in bone.colliders]
        for bone in skeleton.bones
    ]
    for name in _LINED:
        row = skeleton.bone(name)
        frames[row] += [_lining(geom) for geom in frames[row]]
    size = skeleton.growth.head_size
    for eye in EYES:
        x, y, z = MOUNTS_M[eye]
        pupil = Geom(
            Shape.SPHERE,
            (_PUPIL_M * size,),
            (x * size, y * size, z * size),
            colour=PUPILS,
            tangible=False,
        )
        frames[skeleton.bone("head")].append(pupil)
    return frames


def _lining(geom: Geom) -> Geom:
    """Return what is drawn below the skin of a bone, cf. `_geom`."""
    radius, *lengths = geom.size
    size = radius - _LINING_M, *lengths
    return replace(geom, size=size, visible=True, tangible=False, skin_m=0.0)


def _hairy(mesh: Mesh, head: int, head_size: float) -> NDArray[np.bool_]:
    """Return a mask ``(T,)`` of the triangles that have the colour of hair."""
    on_head = np.where(mesh.frames[:, :1] == head, mesh.offsets[:, 0], mesh.offsets[:, 1])
    centres = on_head[mesh.triangles].mean(axis=1)
    above = centres @ _HAIRLINE_NORMAL > _HAIRLINE_M * head_size
    hairy: NDArray[np.bool_] = (mesh.owners == head) & above
    return hairy


def _colour(bone: Bone, shirt: tuple[float, float, float]) -> tuple[float, float, float]:
    part = bone.name.removeprefix("l_").removeprefix("r_")
    colours = {"shirt": shirt, "trousers": TROUSERS, "shoes": SHOES}
    return colours.get(_CLOTHED.get(part, ""), SKIN)


def _geom(part: Primitive, bone: Bone, colour: tuple[float, float, float]) -> Geom:
    """Return a primitive of a bone, grown by the thickness of its skin."""
    skin_m = bone.skin_thickness_m
    whole = part.grown(skin_m)
    return Geom(
        whole.shape,
        whole.size,
        whole.offset,
        whole.rotation,
        colour=colour,
        visible=False,
        skin_m=skin_m,
    )
