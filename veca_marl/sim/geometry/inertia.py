"""Mass properties of primitives of even density, and of rigidly joined parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry.poses import Floats, Pose
from veca_marl.sim.geometry.primitives import Primitive, Shape


class Inertia(NamedTuple):
    """Mass properties of a rigid part in some frame.

    Attributes:
        mass_kg: Mass.
        centre: ``(3,)`` centre of mass, metres.
        matrix: ``(3, 3)`` moment of inertia about the centre of mass, kg m^2.
    """

    mass_kg: float
    centre: Floats
    matrix: Floats


def primitive_inertia(primitive: Primitive, mass_kg: float) -> Inertia:
    """Return the inertia of a primitive of even density, in the frame that it is on."""
    centre, rotation = primitive.pose
    if primitive.hull is not None:
        hull = primitive.hull
        middle = centre + rotation @ hull.centroid
        return Inertia(mass_kg, middle, rotation @ hull.inertia(mass_kg) @ rotation.T)
    if primitive.shape is Shape.BOX:
        squares = (2.0 * np.array(primitive.size)) ** 2
        diagonal = mass_kg / 12.0 * np.diag(squares.sum() - squares)
        return Inertia(mass_kg, centre, rotation @ diagonal @ rotation.T)
    along, across = _moments(primitive, mass_kg)
    axis = rotation[:, 2]
    matrix = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    return Inertia(mass_kg, centre, matrix)


def joined_inertia(parts: Sequence[tuple[Pose, Inertia]]) -> Inertia:
    """Return the inertia of rigidly joined parts (parallel axis theorem).

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


def _moments(primitive: Primitive, mass_kg: float) -> tuple[float, float]:
    """Return the moments about the axis and across it: a cylinder with two half balls as caps."""
    length, radius = primitive.length, primitive.radius
    cylinder = math.pi * radius**2 * length
    caps = 0.0 if primitive.shape is Shape.CYLINDER else 4.0 / 3.0 * math.pi * radius**3
    tube_kg = mass_kg * cylinder / (cylinder + caps)
    caps_kg = mass_kg - tube_kg
    along = tube_kg * radius**2 / 2.0 + caps_kg * 0.4 * radius**2
    across = tube_kg * (length**2 / 12.0 + radius**2 / 4.0)
    across += caps_kg * (0.4 * radius**2 + length**2 / 4.0 + 0.375 * length * radius)
    return along, across
