"""The words rewards are written in."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry.pose import Floats


def cosine(a: Floats, b: Floats) -> float:
    """Return the cosine of the angle between two vectors; 0 if one of them has no length."""
    length = norm(a) * norm(b)
    return float(a.dot(b)) / length if length > 1e-9 else 0.0


def aside_rad(way: Floats, direction: Floats) -> float:
    """Return the angle in [0, pi] between the horizontal parts of two vectors; 0 without length."""
    cross = way[0] * direction[1] - way[1] * direction[0]
    return math.atan2(abs(cross), way[:2].dot(direction[:2]))


def norm(vector: Floats) -> float:
    """Return the length of a vector, to the last bit that of `np.linalg.norm`, which is slow."""
    return math.sqrt(vector.dot(vector))


def flat(vector: Floats) -> Floats:
    """Return the horizontal part of a vector ``(3,)``."""
    return np.array([vector[0], vector[1], 0.0])


def share(value: float, whole: float) -> float:
    """Return how much of a whole is there, in [0, 1]: more than all is no better."""
    return float(min(max(value / whole, 0.0), 1.0))


def along(way: Floats, direction: Floats, time_s: float, top_mps: float) -> float:
    """Return the mean speed along a direction, m/s, at most `top_mps` either way.

    Of the way covered, not of a velocity at one moment: a trembling body has that for nothing.

    Args:
        way: ``(3,)`` metres covered.
        direction: ``(3,)`` of unit length; a shorter one counts less.
        time_s: In this time.
        top_mps: To be faster is no better.
    """
    return float(min(max(way @ direction / time_s, -top_mps), top_mps))


def angle_between_rad(a: Floats, b: Floats) -> float:
    """Return the angle of the turn that takes one orientation ``(3, 3)`` to another, in [0, pi]."""
    cosine_of_turn = (float(np.vdot(a, b)) - 1.0) / 2.0
    return math.acos(min(max(cosine_of_turn, -1.0), 1.0))
