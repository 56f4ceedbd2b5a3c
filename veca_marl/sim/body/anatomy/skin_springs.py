"""Compliant skin in the physics: linear springs (Hooke's law) over the bones.

The skin of hands and feet carries load, so that the depth of penetration depends on the force.
There the compliant layer is a collider of its own over that of the rigid bone, which stops objects
that compress the skin completely. A finger has the compliant collider alone, which saves 30 links:
its own strength cannot compress its skin completely (at most 1.4 N at the tip, against 1.5 to
2 N). The weight of an arm on a fingertip can; the fingertip then penetrates by several millimetres.
All other bones are rigid in the physics.

Touch reads depths from geometry and does not depend on these springs; where the skin is compliant,
its readings vary gradually with the force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.body.anatomy.skeleton import Bone

FINGERS = ("index", "middle", "ring", "little", "thumb")
_DAMPING_RATIO = 0.7
_CARRIED_KG = {True: 0.02, False: 0.5}  # typical load of a finger, of a hand or foot; our choice


class SkinLayer(Enum):
    """Colliders of a bone: the rigid bone, its soft skin, or one over the other."""

    BONE = "bone"
    SKIN = "skin"
    SKIN_OVER_BONE = "skin over bone"


@dataclass(frozen=True)
class SkinSpring:
    """A linear spring per contact point: the force is ``stiffness x depth``.

    Attributes:
        stiffness_npm: N/m: the force that compresses the skin completely, over its thickness.
        damping_nspm: N s/m.
        thickness_m: Depth at which the bone is reached.
    """

    stiffness_npm: float
    damping_nspm: float
    thickness_m: float


def is_finger(bone: Bone) -> bool:
    """Return whether a bone is one of the 30 phalanges."""
    return any(finger in bone.name for finger in FINGERS)


def skin_layer(bone: Bone) -> SkinLayer:
    """Return the kind of colliders of a bone."""
    if is_finger(bone):
        return SkinLayer.SKIN
    return SkinLayer.SKIN_OVER_BONE if bone.name.endswith(("hand", "foot")) else SkinLayer.BONE


def skin_spring(bone: Bone) -> SkinSpring:
    """Return the spring of the skin of a bone."""
    stiffness = bone.skin_force_n / bone.skin_thickness_m
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * _CARRIED_KG[is_finger(bone)])
    return SkinSpring(stiffness, damping, bone.skin_thickness_m)
