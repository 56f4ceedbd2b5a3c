"""Postures in which a joint-level body can be placed: attitude of the pelvis and joint angles.

The angles are ours, chosen by eye.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from veca_marl.sim.body.anatomy import Skeleton
from veca_marl.sim.geometry import Floats


@dataclass(frozen=True)
class Posture:
    """Pitch of the pelvis and the angles of the joints that are not at zero.

    Attributes:
        pitch_deg: Pitch of the pelvis; 0 is upright, 90 prone, -90 supine.
        joints_deg: Angles by joint name (`chest.flexion`); a name without a side
            (`thigh.flexion`) applies to both sides.
    """

    pitch_deg: float = 0.0
    joints_deg: Mapping[str, float] = field(default_factory=dict)


STANDING = Posture()
ON_BACK = Posture(-90.0, {"upper_arm.abduction": 30.0, "forearm.flexion": 20.0})
ON_BELLY = Posture(
    90.0, {"upper_arm.abduction": 50.0, "forearm.flexion": 20.0, "foot.dorsiflexion": -55.0}
)
SITTING = Posture(
    5.0,
    {
        "thigh.flexion": 95.0,
        "thigh.abduction": 30.0,
        "shank.flexion": 15.0,
        "spine.flexion": 12.0,
        "upper_arm.flexion": 20.0,
        "forearm.flexion": 20.0,
    },
)
_REACHING = {
    "thigh.flexion": 95.0,
    "thigh.abduction": 45.0,
    "shank.flexion": 15.0,
    "neck.flexion": -30.0,
    "upper_arm.flexion": 30.0,
    "upper_arm.abduction": 35.0,
    "forearm.flexion": 95.0,
    # thumbs in the plane of the hand, so that the palms can take objects
    "thumb_metacarpal.flexion": -20.0,
    "thumb_proximal.flexion": -10.0,
    "thumb_distal.flexion": -15.0,
}


def reaching(spine_deg: float, chest_deg: float) -> Posture:
    """Return a stable seat for manipulation: legs apart, hands above the floor between them.

    Args:
        spine_deg: Forward flexion of the spine.
        chest_deg: Forward flexion of the chest.
    """
    return Posture(5.0, {**_REACHING, "spine.flexion": spine_deg, "chest.flexion": chest_deg})


REACHING = reaching(25.0, 20.0)
REACHING_DOWN = reaching(35.0, 25.0)
# supine, the right arm out to the side, palm up: an object on the palm stays there
OFFERING = Posture(
    -90.0,
    {
        "l_upper_arm.abduction": 30.0,
        "r_upper_arm.abduction": 90.0,
        "r_forearm.pronation": -85.0,
        "r_thumb_metacarpal.flexion": -20.0,
        "r_thumb_proximal.flexion": -10.0,
        "r_thumb_distal.flexion": -15.0,
    },
)
ON_ALL_FOURS = Posture(
    85.0,
    {
        "thigh.flexion": 90.0,
        "shank.flexion": 95.0,
        "foot.dorsiflexion": -50.0,
        "upper_arm.flexion": 85.0,
        "hand.flexion": -75.0,
        "neck.flexion": -40.0,
    },
)
POSTURES: dict[str, Posture] = {
    "standing": STANDING,
    "on_back": ON_BACK,
    "on_belly": ON_BELLY,
    "sitting": SITTING,
    "on_all_fours": ON_ALL_FOURS,
    "offering": OFFERING,
    "reaching": REACHING,
    "reaching_down": REACHING_DOWN,
}


def posture_angles(skeleton: Skeleton, posture: Posture) -> Floats:
    """Return the ``(82,)`` joint angles of a posture, rad.

    Raises:
        ValueError: If a joint is unknown, or an angle is outside its limits.
    """
    angles = np.zeros(len(skeleton.joints))
    for name, degrees in posture.joints_deg.items():
        for joint in _joints(skeleton, name):
            angles[joint] = math.radians(degrees)
    check_angles(skeleton, angles)
    return angles


def perturbed(
    skeleton: Skeleton, posture: Posture, spread_deg: float, rng: np.random.Generator
) -> Posture:
    """Return a posture with a normally distributed deviation of every joint.

    Args:
        skeleton: The table of joints.
        posture: The mean.
        spread_deg: Standard deviation; angles are clipped to the joint limits.
        rng: Random generator.
    """
    angles = posture_angles(skeleton, posture)
    angles += rng.normal(0.0, math.radians(spread_deg), len(angles))
    low = [joint.low_rad for joint in skeleton.joints]
    high = [joint.high_rad for joint in skeleton.joints]
    names = [f"{joint.bone}.{joint.label}" for joint in skeleton.joints]
    degrees = np.degrees(np.clip(angles, low, high))
    return Posture(posture.pitch_deg, dict(zip(names, degrees.tolist(), strict=True)))


def check_angles(skeleton: Skeleton, angles: Floats) -> None:
    """Raise `ValueError` for the first angle that is outside the limits of its joint."""
    for joint, angle in zip(skeleton.joints, angles, strict=True):
        # written so that a NaN fails as well
        if not joint.low_rad <= angle <= joint.high_rad:
            low, high = math.degrees(joint.low_rad), math.degrees(joint.high_rad)
            raise ValueError(
                f"{joint.bone}.{joint.label} cannot be at {math.degrees(angle):.6g} degrees: "
                f"it moves from {low:.6g} to {high:.6g}"
            )


def pelvis_rotation(posture: Posture, yaw_rad: float) -> Floats:
    """Return the rotation ``(3, 3)`` of the pelvis in the world: pitch, then `yaw_rad`."""
    pitch = math.radians(posture.pitch_deg)
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])


def _joints(skeleton: Skeleton, name: str) -> list[int]:
    """Return the joint with a name, or the two joints of a name without a side."""
    names = [f"{joint.bone}.{joint.label}" for joint in skeleton.joints]
    found = [names.index(n) for n in (name, f"l_{name}", f"r_{name}") if n in names]
    if not found:
        raise ValueError(f"no joint {name!r}; there are {names}")
    return found
