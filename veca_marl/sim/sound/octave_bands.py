"""Octave bands, and the filters that give a path a level in each of them."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

BANDS_HZ: Floats = 125.0 * 2.0 ** np.arange(7, dtype=np.float64)
"""Middles of the octave bands, 125 Hz to 8 kHz (IEC 61260)."""

N_BANDS = len(BANDS_HZ)

_RIDGE = 0.03  # of the fit: the smallest with errors below 1 dB behind one and two walls
_LEAST = 1e-18  # energy, -180 dB


def shelf_filters(energy: Floats, sample_rate_hz: float) -> NDArray[np.float32]:
    """Return filters with given energies in the octave bands.

    A gain and first-order shelves, one between each two bands; a step of a shelf is proportional to
    its level in dB at all frequencies to first order (Jot 2015, Proportional parametric equalizers,
    AES Convention 139), so that the steps follow from the levels by one matrix. The errors are
    below 0.7 dB at the middles of the bands behind one wall or one edge. Filters have minimum
    phase: they add no delay.

    Args:
        energy: ``(K, N_BANDS)`` from 0 to 1.
        sample_rate_hz: Sampling rate; bands above 0.4 of it have the level of the last one below.

    Returns:
        ``(K, N_BANDS - 1, 3)``: coefficients b0, b1 and a1 of each section; the gain is in the
        first.
    """
    sections = np.empty((len(energy), N_BANDS - 1, 3), np.float32)
    _write_sections(energy, _fit(sample_rate_hz), _crossovers(sample_rate_hz), sections)
    return sections


@njit(cache=True, error_model="numpy")
def _write_sections(
    energy: Floats, fit: Floats, crossovers: Floats, sections: NDArray[np.float32]
) -> None:
    """Write the coefficients of `shelf_filters`.

    Args:
        energy: ``(K, N_BANDS)`` from 0 to 1.
        fit: See `_fit`.
        crossovers: See `_crossovers`.
        sections: ``(K, N_BANDS - 1, 3)``, overwritten.
    """
    levels = np.empty(N_BANDS)
    for k in range(energy.shape[0]):
        for band in range(N_BANDS):
            levels[band] = 0.5 * math.log(max(energy[k, band], _LEAST))
        gain = 0.0
        for band in range(N_BANDS):
            gain += levels[band] * fit[band, 0]
        gain = math.exp(gain)
        for s in range(N_BANDS - 1):
            step = 0.0
            for band in range(N_BANDS):
                step += levels[band] * fit[band, s + 1]
            step = math.exp(step)
            pole = math.sqrt(step) * crossovers[s]
            sections[k, s, 0] = gain * (step + pole) / (1.0 + pole)
            sections[k, s, 1] = gain * (pole - step) / (1.0 + pole)
            sections[k, s, 2] = (pole - 1.0) / (1.0 + pole)
            gain = 1.0


def unshaded(n_paths: int) -> NDArray[np.float32]:
    """Return filters that change nothing, in the form of `shelf_filters`."""
    sections = np.zeros((n_paths, N_BANDS - 1, 3), np.float32)
    sections[..., 0] = 1.0
    return sections


@cache
def _crossovers(sample_rate_hz: float) -> Floats:
    """Return the tangents of half of the angular frequencies between bands, ``(N_BANDS - 1,)``."""
    between_hz = np.minimum(np.sqrt(BANDS_HZ[1:] * BANDS_HZ[:-1]), 0.4 * sample_rate_hz)
    tangents: Floats = np.tan(np.pi * between_hz / sample_rate_hz)
    return tangents


@cache
def _fit(sample_rate_hz: float) -> Floats:
    """Return the matrix from levels in bands to the gain and the steps in dB, both in rows."""
    middles_hz = np.minimum(BANDS_HZ, 0.45 * sample_rate_hz)
    middles = np.tan(np.pi * middles_hz / sample_rate_hz)
    shapes = 1.0 / (1.0 + (_crossovers(sample_rate_hz) / middles[:, None]) ** 2)
    response = np.column_stack([np.ones(N_BANDS), shapes])
    differences = np.eye(N_BANDS) - np.eye(N_BANDS, k=-1)
    normal = response.T @ response + _RIDGE * np.eye(N_BANDS)
    fitted: Floats = np.linalg.solve(normal, response.T + _RIDGE * differences).T.astype(np.float64)
    return fitted
