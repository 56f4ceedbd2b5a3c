"""Quantities that reward terms are composed of: distances, angles, shares, speeds."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry import Floats


def cosine(a: Floats, b: Floats) -> float:
    """Return the cosine of the angle between two vectors; 0 if one of them has length 0."""
    length = norm(a) * norm(b)
    return float(a.dot(b)) / length if length > 1e-9 else 0.0


def horizontal_angle_rad(a: Floats, b: Floats) -> float:
    """Return the angle in [0, pi] between the horizontal parts of two vectors.

    Returns 0 if one of the horizontal parts has length 0.
    """
    cross = a[0] * b[1] - a[1] * b[0]
    return math.atan2(abs(cross), a[:2].dot(b[:2]))


def norm(vector: Floats) -> float:
    """Return the length of a vector: bit-equal to `np.linalg.norm`, and faster."""
    return math.sqrt(vector.dot(vector))


def horizontal(vector: Floats) -> Floats:
    """Return a vector ``(3,)`` with its vertical component set to 0."""
    return np.array([vector[0], vector[1], 0.0])


def clipped_share(value: float, whole: float) -> float:
    """Return ``value / whole``, clipped to [0, 1]."""
    return float(min(max(value / whole, 0.0), 1.0))


def rotation_angle_rad(a: Floats, b: Floats) -> float:
    """Return the angle in [0, pi] of the rotation between two orientations ``(3, 3)``."""
    cosine_of_angle = (float(np.vdot(a, b)) - 1.0) / 2.0
    return math.acos(min(max(cosine_of_angle, -1.0), 1.0))
