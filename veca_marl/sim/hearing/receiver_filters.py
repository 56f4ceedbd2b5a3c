"""Compiled loops that write the delay and the filter of every path to a receiver."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.near_field import NEAREST_RADII, near_field_gain


@njit(cache=True)
def _length(vector: Floats) -> float:
    return float(np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2))


@njit(cache=True)
def omnidirectional_paths(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    ears: Floats,
    nearest_m: float,
    delays: Floats,
    filters: NDArray[np.float32],
) -> None:
    """Write the paths to omnidirectional receivers.

    Args:
        arrivals: ``(K, 3)`` metres in the head frame.
        gains: ``(K,)`` product of the walls' reflection and transmission coefficients of each.
        samples_per_metre: Sampling rate divided by the speed of sound.
        ears: ``(E, 3)`` metres in the head frame.
        nearest_m: Distance below which the gain is constant.
        delays: ``(K, E)`` samples, overwritten.
        filters: ``(K, E, 1)``, overwritten.
    """
    for k in range(arrivals.shape[0]):
        for ear in range(ears.shape[0]):
            distance = _length(arrivals[k] - ears[ear])
            delays[k, ear] = distance * samples_per_metre
            filters[k, ear, 0] = np.float32(gains[k] / max(distance, nearest_m))


@njit(cache=True)
def _grid_cell(
    arrival: Floats, distance: float, n_azimuths: int, n_elevations: int
) -> tuple[int, int, int, float, float]:
    """Return azimuth indices around a direction, the elevation index below, and both fractions."""
    azimuth = np.arctan2(arrival[1], arrival[0]) * (n_azimuths / (2.0 * np.pi))
    sine = min(max(arrival[2] / max(distance, 1e-9), -1.0), 1.0)
    elevation = (np.arcsin(sine) / np.pi + 0.5) * (n_elevations - 1)
    below = int(np.floor(azimuth))
    low = min(int(elevation), n_elevations - 2)
    near, far = below % n_azimuths, (below + 1) % n_azimuths
    return near, far, low, azimuth - below, elevation - low


@njit(cache=True)
def head_related_paths(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    table: NDArray[np.float32],
    arrival_samples: Floats,
    radius_m: float,
    measured_at_m: float,
    delays: Floats,
    filters: NDArray[np.float32],
) -> None:
    """Write the paths to two ears on a head, each with the response of its direction.

    Args:
        arrivals: ``(K, 3)`` metres in the head frame.
        gains: ``(K,)`` product of the walls' reflection and transmission coefficients of each.
        samples_per_metre: Sampling rate divided by the speed of sound.
        table: ``(A, E, 2, T)``, see `HrtfTable.filters`; interpolated bilinearly.
        arrival_samples: ``(A, E, 2)``, see `HrtfTable`.
        radius_m: Radius of the head.
        measured_at_m: Distance at which the responses were measured.
        delays: ``(K, 2)`` samples, overwritten.
        filters: ``(K, 2, T)``, overwritten.
    """
    n_azimuths, n_elevations, n_ears, n_taps = table.shape
    for k in range(arrivals.shape[0]):
        distance = _length(arrivals[k])
        a0, a1, e0, along, up = _grid_cell(arrivals[k], distance, n_azimuths, n_elevations)
        w00, w10 = (1.0 - along) * (1.0 - up), along * (1.0 - up)
        w01, w11 = (1.0 - along) * up, along * up
        limited = max(distance, NEAREST_RADII * radius_m)
        to_left = arrivals[k, 1] / limited
        for ear in range(n_ears):
            cosine = to_left if ear == 0 else -to_left
            near = near_field_gain(radius_m, limited, measured_at_m, cosine)
            amplitude = gains[k] / limited * near
            c00, c10 = np.float32(amplitude * w00), np.float32(amplitude * w10)
            c01, c11 = np.float32(amplitude * w01), np.float32(amplitude * w11)
            interaural = (
                w00 * arrival_samples[a0, e0, ear]
                + w10 * arrival_samples[a1, e0, ear]
                + w01 * arrival_samples[a0, e0 + 1, ear]
                + w11 * arrival_samples[a1, e0 + 1, ear]
            )
            # negative only inside the head
            delays[k, ear] = max(distance * samples_per_metre + interaural, 0.0)
            for tap in range(n_taps):
                filters[k, ear, tap] = (
                    c00 * table[a0, e0, ear, tap]
                    + c10 * table[a1, e0, ear, tap]
                    + c01 * table[a0, e0 + 1, ear, tap]
                    + c11 * table[a1, e0 + 1, ear, tap]
                )
