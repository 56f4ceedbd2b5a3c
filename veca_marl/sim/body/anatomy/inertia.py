"""Mass properties of bones: capsules and boxes of even density, and what they weigh together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy.skeleton import Bone, BoneBox, BoneCapsule
from veca_marl.sim.geometry.pose import Floats, Pose


class Inertia(NamedTuple):
    """Mass (kg), centre of mass ``(3,)`` (m) and inertia ``(3, 3)`` about it (kg m^2)."""

    mass_kg: float
    centre: Floats
    matrix: Floats


def bone_inertia(bone: Bone) -> Inertia:
    """Spread the mass of a bone evenly over its first collider with the skin on."""
    part, skin = bone.colliders[0], bone.skin_thickness_m
    if isinstance(part, BoneBox):
        edges = 2.0 * (np.array(part.half) + skin)
        return Inertia(bone.mass_kg, np.array(part.centre), _box(bone.mass_kg, edges))
    start, end = np.array(part.start), np.array(part.end)
    return Inertia(bone.mass_kg, (start + end) / 2.0, _capsule(bone.mass_kg, part, skin))


def joined(parts: Sequence[tuple[Pose, Inertia]]) -> Inertia:
    """Return what rigidly joined parts weigh together (parallel axis theorem).

    Args:
        parts: The pose of each part in the common frame, and its inertia in its own.
    """
    mass = sum(part.mass_kg for _, part in parts)
    centres = [pose.position + pose.rotation @ part.centre for pose, part in parts]
    centre = sum((p.mass_kg * c for (_, p), c in zip(parts, centres, strict=True)), np.zeros(3))
    centre /= mass
    matrix = np.zeros((3, 3))
    for (pose, part), own_centre in zip(parts, centres, strict=True):
        away = own_centre - centre
        matrix += pose.rotation @ part.matrix @ pose.rotation.T
        matrix += part.mass_kg * (away @ away * np.eye(3) - np.outer(away, away))
    return Inertia(mass, centre, matrix)


def _box(mass_kg: float, edges: Floats) -> Floats:
    squares = edges**2
    return mass_kg / 12.0 * np.diag(squares.sum() - squares)


def _capsule(mass_kg: float, part: BoneCapsule, skin_m: float) -> Floats:
    """A cylinder with two half balls as caps."""
    way = np.array(part.end) - np.array(part.start)
    length, radius = float(np.linalg.norm(way)), part.radius + skin_m
    cylinder, caps = math.pi * radius**2 * length, 4.0 / 3.0 * math.pi * radius**3
    tube_kg = mass_kg * cylinder / (cylinder + caps)
    caps_kg = mass_kg - tube_kg
    along = tube_kg * radius**2 / 2.0 + caps_kg * 0.4 * radius**2
    across = tube_kg * (length**2 / 12.0 + radius**2 / 4.0)
    across += caps_kg * (0.4 * radius**2 + length**2 / 4.0 + 0.375 * length * radius)
    axis = way / length
    return across * np.eye(3) + (along - across) * np.outer(axis, axis)
