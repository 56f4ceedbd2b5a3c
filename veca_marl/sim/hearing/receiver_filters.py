"""Compiled loops that sum direct sound and reflections to the filters of a receiver."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound import KERNEL_TAPS, NEAR_FIELD_M, fractional_kernel


@njit(cache=True)
def _length(vector: Floats) -> float:
    return float(np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2))


@njit(cache=True)
def _split(position: float, last: int) -> tuple[int, float]:
    """Split a position in samples, clipped to the filter, into integer part and fraction."""
    clipped = min(max(position, 0.0), float(last))
    whole = min(int(clipped), last - 1)
    return whole, clipped - whole


@njit(cache=True)
def omnidirectional_filters(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    lead: int,
    ears: Floats,
    bank: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Sum all arrivals at omnidirectional receivers.

    Args:
        arrivals: ``(K, 3)`` metres in the head frame, direct sound first.
        gains: ``(K,)`` product of the walls' reflection and transmission coefficients of each.
        samples_per_metre: Sampling rate divided by the speed of sound.
        lead: Samples by which the filter is delayed, so that it stays causal.
        ears: ``(E, 3)`` metres in the head frame.
        bank: `kernel_bank`.
        out: ``(E, n)``, overwritten.
    """
    kernel = np.empty(KERNEL_TAPS, np.float32)
    direct = _length(arrivals[0])
    out[:] = 0.0
    last = out.shape[1] - KERNEL_TAPS
    for k in range(arrivals.shape[0]):
        for ear in range(ears.shape[0]):
            distance = _length(arrivals[k] - ears[ear])
            position = lead + (distance - direct) * samples_per_metre
            whole, fraction = _split(position, last)
            fractional_kernel(bank, fraction, kernel)
            amplitude = np.float32(gains[k] / max(distance, NEAR_FIELD_M))
            for tap in range(KERNEL_TAPS):
                out[ear, whole + tap] += amplitude * kernel[tap]


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
def head_related_filters(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    lead: int,
    filters: NDArray[np.float32],
    arrival_samples: Floats,
    bank: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Sum all arrivals at two ears on a head, each filtered by the response of its direction.

    Args:
        arrivals: ``(K, 3)`` metres in the head frame, direct sound first.
        gains: ``(K,)`` product of the walls' reflection and transmission coefficients of each.
        samples_per_metre: Sampling rate divided by the speed of sound.
        lead: Samples by which the filter is delayed, so that it stays causal.
        filters: ``(A, E, 2, T)``, see `HrtfTable`; interpolated bilinearly.
        arrival_samples: ``(A, E, 2)``, see `HrtfTable`.
        bank: `kernel_bank`.
        out: ``(2, n)``, overwritten.
    """
    n_azimuths, n_elevations, n_ears, n_taps = filters.shape
    kernel = np.empty(KERNEL_TAPS, np.float32)
    blended = np.empty(n_taps, np.float32)
    direct = _length(arrivals[0])
    out[:] = 0.0
    last = out.shape[1] - n_taps - KERNEL_TAPS
    for k in range(arrivals.shape[0]):
        distance = _length(arrivals[k])
        a0, a1, e0, along, up = _grid_cell(arrivals[k], distance, n_azimuths, n_elevations)
        w00, w10 = (1.0 - along) * (1.0 - up), along * (1.0 - up)
        w01, w11 = (1.0 - along) * up, along * up
        amplitude = gains[k] / max(distance, NEAR_FIELD_M)
        for ear in range(n_ears):
            interaural = (
                w00 * arrival_samples[a0, e0, ear]
                + w10 * arrival_samples[a1, e0, ear]
                + w01 * arrival_samples[a0, e0 + 1, ear]
                + w11 * arrival_samples[a1, e0 + 1, ear]
            )
            position = lead + (distance - direct) * samples_per_metre
            whole, fraction = _split(position + interaural, last)
            fractional_kernel(bank, fraction, kernel)
            c00, c10 = np.float32(amplitude * w00), np.float32(amplitude * w10)
            c01, c11 = np.float32(amplitude * w01), np.float32(amplitude * w11)
            for tap in range(n_taps):
                blended[tap] = (
                    c00 * filters[a0, e0, ear, tap]
                    + c10 * filters[a1, e0, ear, tap]
                    + c01 * filters[a0, e0 + 1, ear, tap]
                    + c11 * filters[a1, e0 + 1, ear, tap]
                )
            for lag in range(KERNEL_TAPS):
                coefficient = kernel[lag]
                row = out[ear, whole + lag : whole + lag + n_taps]
                for tap in range(n_taps):
                    row[tap] += coefficient * blended[tap]
