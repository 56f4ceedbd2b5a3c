"""The chart of the skin: anatomical position with the soles turned backwards and large hands.

As in the sensory homunculus (Penfield & Boldrey 1937), hands are larger than they are: a finger of
real size would be a line of one pixel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton, forward_kinematics, load_skeleton
from veca_marl.sim.geometry import Floats

# palms face forward as in anatomical atlases; the toes point down, so that the soles are seen from
# behind
_CHART_DEG = {
    "upper_arm.abduction": 38.0,
    "forearm.pronation": -85.0,
    "thigh.abduction": 10.0,
    "foot.dorsiflexion": -45.0,
}
_HAND_SCALE = 2.3


def chart_pose() -> Floats:
    """Return the matrix of each bone and its position side by side, ``(47, 3, 4)``.

    The matrices are rotations, those of the hands with a scale.
    """
    skeleton = load_skeleton()
    angles = np.zeros(len(skeleton.joints))
    for name, degrees in _CHART_DEG.items():
        bone, label = name.split(".")
        for side in "lr":
            angles[skeleton.joint(f"{side}_{bone}", label)] = math.radians(degrees)
    count = len(skeleton.bones)
    positions, rotations = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
    forward_kinematics(skeleton, angles, positions, rotations)
    for side in "lr":
        hand = skeleton.bone(f"{side}_hand")
        own = [b for b in range(count) if hand in (b, *_ancestors(skeleton, b))]
        rotations[own] *= _HAND_SCALE
        positions[own] = positions[hand] + _HAND_SCALE * (positions[own] - positions[hand])
    pose: Floats = np.concatenate([rotations, positions[:, :, None]], axis=2)
    return pose


def _ancestors(skeleton: Skeleton, bone: int) -> Iterator[int]:
    """Yield the parent of a bone, its parent, and so on."""
    while (bone := skeleton.bones[bone].parent) >= 0:
        yield bone
