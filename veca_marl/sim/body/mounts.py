"""Where the sense organs sit in the head, and how the eyes turn in it.

Distances are those of a child of about one year, in the frame of the head bone (origin at the top
of the neck): the interpupillary distance of 45 mm and the head breadth of 128 mm are of the size
that anthropometry reports for that age (from memory, not checked against a table); the rest
follows from the head of our skeleton.
"""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Bone
from veca_marl.sim.geometry.pose import Floats, Pose
from veca_marl.sim.geometry.primitives import Shape

ORGANS_M: dict[str, tuple[float, float, float]] = {
    "head": (0.010, 0.0, 0.066),
    "eye_left": (0.078, 0.0225, 0.075),
    "eye_right": (0.078, -0.0225, 0.075),
    "ear_left": (0.010, 0.064, 0.066),
    "ear_right": (0.010, -0.064, 0.066),
    "mouth": (0.088, 0.0, 0.030),
}
EYES = ("eye_left", "eye_right")


def organ_pose(name: str, head: Pose) -> Pose:
    """Return the pose of an organ at rest in the head; raise `KeyError` listing the organs."""
    try:
        offset = ORGANS_M[name]
    except KeyError:
        raise KeyError(f"no mount {name!r}; there are {list(ORGANS_M)}") from None
    return Pose(head.position + head.rotation @ np.array(offset), head.rotation)


def gaze(eye: Pose, point: Floats, range_rad: float) -> Pose:
    """Turn an eye toward a point, as far as its muscles reach.

    Args:
        eye: Pose of the eye at rest.
        point: ``(3,)`` metres, world frame.
        range_rad: Greatest turn to either side and up or down.

    Returns:
        The pose whose x axis points at `point` or, beyond the range, as near as it can.
    """
    x, y, z = eye.rotation.T @ (point - eye.position)
    yaw = min(max(math.atan2(y, x), -range_rad), range_rad)
    pitch = min(max(math.atan2(z, math.hypot(x, y)), -range_rad), range_rad)
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    turn = np.array([[cy * cp, -sy, -cy * sp], [sy * cp, cy, -sy * sp], [sp, 0.0, cp]])
    return Pose(eye.position, eye.rotation @ turn)


def palm_of(hand: Bone) -> Floats:
    """Return the middle of the palm's skin in the frame of a hand, ``(3,)`` metres.

    Raises:
        ValueError: If the bone has no box, which is what a hand is made of.
    """
    for part in hand.colliders:
        if part.shape is Shape.BOX:
            # palms face inward, the thighs of a standing body: -y on the left, +y on the right
            inward = -1.0 if hand.name.startswith("l_") else 1.0
            x, y, z = part.pose.position
            return np.array([x, y + inward * (part.size[1] + hand.skin_thickness_m), z])
    raise ValueError(f"{hand.name} is no hand: it is not made of a box")
