"""Where the skin gives way in the physics, and how: Hooke's springs over bones.

Skin carries weight on hands and feet, so that what lies on them is felt by how deep it sinks in.
There the compliant layer is a collider of its own over the rigid bone; the bone stops what presses
through. A finger has the compliant collider alone, which saves 30 links: by its own strength it
cannot press through its skin (at most 1.4 N at the tip, against 1.5 to 2 N). The weight of an arm
on a fingertip can, and sinks it several millimetres into what it lies on. Elsewhere the bone is all
the physics knows.
Touch reads depths from geometry and needs none of this; it is only felt more finely where skin
yields.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.body.anatomy.skeleton import Bone

FINGERS = ("index", "middle", "ring", "little", "thumb")
_DAMPING_RATIO = 0.7
_CARRIED_KG = {True: 0.02, False: 0.5}  # what a finger, a hand or a foot typically meets; ours


class SkinLayer(Enum):
    """What the physics knows of a bone: the rigid bone, its soft skin, or one over the other."""

    BONE = "bone"
    SKIN = "skin"
    SKIN_OVER_BONE = "skin over bone"


@dataclass(frozen=True)
class SkinSpring:
    """A linear spring per contact point: the force is ``stiffness x depth``.

    Attributes:
        stiffness_npm: N/m. The force that reaches the bone over the thickness of the skin.
        damping_nspm: N s/m.
        thickness_m: Depth at which the bone is reached.
    """

    stiffness_npm: float
    damping_nspm: float
    thickness_m: float


def is_finger(bone: Bone) -> bool:
    """Say whether a bone is one of the 30 phalanges."""
    return any(finger in bone.name for finger in FINGERS)


def skin_layer(bone: Bone) -> SkinLayer:
    """Return what the physics knows of a bone."""
    if is_finger(bone):
        return SkinLayer.SKIN
    return SkinLayer.SKIN_OVER_BONE if bone.name.endswith(("hand", "foot")) else SkinLayer.BONE


def skin_spring(bone: Bone) -> SkinSpring:
    """Return the spring that the skin of a bone is."""
    stiffness = bone.skin_force_n / bone.skin_thickness_m
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * _CARRIED_KG[is_finger(bone)])
    return SkinSpring(stiffness, damping, bone.skin_thickness_m)
