"""Directions below the lowest measured ring: which ones stand in for them, and arrival times."""

from __future__ import annotations

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.spherical_head import ear_incidence, woodworth_arrival_s


def stand_ins(directions: Floats, lowest_rad: float) -> tuple[Floats, Floats]:
    """Return two directions of the lowest ring for each direction below it, and their weights.

    Both have the lateral angle of the direction, on which interaural differences depend most
    (the cone of confusion); one lies in front and one behind. The weights change linearly with the
    angle around the ear axis, so that a response is continuous under the head and equals that of
    the ring on the ring.

    Args:
        directions: ``(..., 3)`` unit vectors with an elevation of at most `lowest_rad`.
        lowest_rad: Elevation of the ring, above -pi / 2.

    Returns:
        ``(..., 2, 3)`` unit vectors on the ring, the one in front first, and weights ``(..., 2)``.
    """
    lateral = directions[..., 1]
    down = np.sin(lowest_rad)
    forward = np.sqrt(np.maximum(np.cos(lowest_rad) ** 2 - lateral**2, 0.0))
    front = np.stack([forward, lateral, np.full_like(lateral, down)], axis=-1)
    behind = front * np.array([-1.0, 1.0, 1.0])
    # angles below the horizontal plane around the ear axis, counted from the front
    around = np.arctan2(-directions[..., 2], directions[..., 0])
    first = np.arctan2(-down, forward)
    to_behind = np.clip((around - first) / np.maximum(np.pi - 2.0 * first, 1e-9), 0.0, 1.0)
    return np.stack([front, behind], axis=-2), np.stack([1.0 - to_behind, to_behind], axis=-1)


def arrival_below_s(below: Floats, ring: Floats, ring_arrival_s: Floats, radius_m: float) -> Floats:
    """Return arrival times ``(A, E, 2)`` in s of directions below the lowest measured ring.

    They are Woodworth's plus a correction. On the ring it is the difference between the measured
    times and Woodworth's, so that times are continuous there; at the nadir it is the mean of the
    differences over all azimuths and both ears, so that times do not depend on the azimuth. In
    between it changes in proportion to the horizontal component of the direction.

    Args:
        below: ``(A, E, 3)`` unit vectors.
        ring: ``(A, 1, 3)`` unit vectors on the ring with the same azimuths.
        ring_arrival_s: ``(A, 1, 2)`` measured times of these.
        radius_m: Radius of the sphere that fits the measured times.
    """
    difference_s = ring_arrival_s - woodworth_arrival_s(ear_incidence(ring), radius_m)
    mean_s = difference_s.mean()
    share = _horizontal(below) / _horizontal(ring)
    sphere_s = woodworth_arrival_s(ear_incidence(below), radius_m)
    arrival_s: Floats = sphere_s + mean_s + share * (difference_s - mean_s)
    return arrival_s


def _horizontal(directions: Floats) -> Floats:
    """Return the lengths ``(..., 1)`` of the horizontal components of unit vectors."""
    lengths: Floats = np.linalg.norm(directions[..., :2], axis=-1, keepdims=True)
    return lengths
