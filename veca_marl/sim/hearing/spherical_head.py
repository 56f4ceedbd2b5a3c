"""Rigid-sphere model of the head: arrival times (Woodworth) and responses (Duda & Martens)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import spherical_jn, spherical_yn

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound import SPEED_OF_SOUND_MPS

HEAD_RADIUS_M = 0.0875
"""Radius of an average adult's head (Hartley & Fry 1921, after Duda & Martens 1998)."""

_MAX_TERMS = 200
_TOLERANCE = 1e-8
_MIN_WAVE_NUMBER = 1e-3


def ear_incidence(directions: Floats) -> Floats:
    """Return the angles ``(..., 2)`` in rad of unit vectors ``(..., 3)`` to the two ear axes."""
    left = np.clip(directions[..., 1], -1.0, 1.0)
    incidence: Floats = np.stack([np.arccos(left), np.arccos(-left)], axis=-1)
    return incidence


def woodworth_arrival_s(incidence_rad: ArrayLike, radius_m: float = HEAD_RADIUS_M) -> Floats:
    """Return the arrival time of a distant source at an ear, relative to the absent head's centre.

    Woodworth's ray around the sphere (Woodworth & Schlosberg 1954; Kuhn 1977, eq. 2).

    Args:
        incidence_rad: Angle between the ear's axis and the direction of the source, in [0, pi].
        radius_m: Radius of the head.

    Returns:
        Seconds, negative on the side of the source; shape of the angle.
    """
    angle = np.asarray(incidence_rad, dtype=np.float64)
    lit = -np.cos(angle)
    shadowed = angle - np.pi / 2.0
    arrival: Floats = radius_m / SPEED_OF_SOUND_MPS * np.where(angle < np.pi / 2.0, lit, shadowed)
    return arrival


def sphere_response(
    incidence_rad: ArrayLike,
    frequency_hz: ArrayLike,
    radius_m: float = HEAD_RADIUS_M,
    distance_m: float = 1.4,
) -> NDArray[np.complex128]:
    """Return the pressure on a rigid sphere, relative to that at its centre in the free field.

    Duda & Martens (1998), eq. 3 and 4, multiplied by the source's distance factor: for a distant
    source the limit at low frequency is 1.

    Args:
        incidence_rad: ``(A,)`` angles as in `woodworth_arrival_s`.
        frequency_hz: ``(F,)``.
        radius_m: Radius of the sphere.
        distance_m: Distance of the point source from the centre, greater than the radius.

    Returns:
        ``(A, F)`` complex; a delay of t seconds is ``exp(-2j pi f t)``.
    """
    cosine = np.cos(np.atleast_1d(np.asarray(incidence_rad, dtype=np.float64)))
    frequencies = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    wave_numbers = 2.0 * np.pi * frequencies * radius_m / SPEED_OF_SOUND_MPS
    ratio = distance_m / radius_m
    columns = [_series(cosine, max(mu, _MIN_WAVE_NUMBER), ratio) for mu in wave_numbers]
    return np.stack(columns, axis=1)


def _series(cosine: Floats, mu: float, ratio: float) -> NDArray[np.complex128]:
    """Sum the spherical harmonics of one frequency until three terms in a row are negligible."""
    total = np.zeros(cosine.shape, dtype=np.complex128)
    legendre, previous = np.ones_like(cosine), np.zeros_like(cosine)
    negligible = 0
    for m in range(_MAX_TERMS):
        slope = spherical_jn(m, mu, derivative=True) + 1j * spherical_yn(m, mu, derivative=True)
        if not np.isfinite(slope) or abs(slope) > 1e280:
            break
        outgoing = spherical_jn(m, mu * ratio) + 1j * spherical_yn(m, mu * ratio)
        term = (2 * m + 1) * legendre * outgoing / slope
        total += term
        negligible = negligible + 1 if np.abs(term).max() < _TOLERANCE * np.abs(total).max() else 0
        if negligible == 3:
            break
        legendre, previous = ((2 * m + 1) * cosine * legendre - m * previous) / (m + 1), legendre
    response: NDArray[np.complex128] = np.conj(-ratio / mu * np.exp(-1j * mu * ratio) * total)
    return response
