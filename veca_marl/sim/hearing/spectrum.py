"""The observed spectrum: log magnitudes of the Fourier transform of the last samples."""

from __future__ import annotations

from enum import Enum

import numpy as np
import scipy.fft
from numpy.typing import NDArray

WINDOW_SAMPLES = 1024
N_BINS = 250
MAGNITUDE_FLOOR = 1e-8
"""Added to each magnitude before the logarithm, as in the paper's code."""

SILENCE = -8.0
"""``log10(MAGNITUDE_FLOOR)``, the observed value of exact silence."""


class Window(Enum):
    """Weights of the samples before the Fourier transform; the paper's is rectangular."""

    rectangular = "rectangular"
    hann = "hann"


def window_weights(window: Window) -> NDArray[np.float32]:
    """Return the ``(1024,)`` weights of a window (Hann: periodic, as for spectral analysis)."""
    if window is Window.hann:
        return np.hanning(WINDOW_SAMPLES + 1)[:-1].astype(np.float32)
    return np.ones(WINDOW_SAMPLES, np.float32)


def noise_power(noise_floor_db: float | None, weights: NDArray[np.float32]) -> float:
    """Return the expected squared magnitude of white noise in one bin.

    Args:
        noise_floor_db: Level of the noise relative to an rms pressure of 1; None for no noise.
        weights: ``(1024,)`` weights of the window.
    """
    if noise_floor_db is None:
        return 0.0
    return float(10.0 ** (noise_floor_db / 10.0) * (weights**2).sum())


def log_spectrum(samples: NDArray[np.float32], noise_power: float = 0.0) -> NDArray[np.float32]:
    """Return ``log10(|rfft(samples)| + 1e-8)`` of the first 250 bins.

    Args:
        samples: ``(..., 1024)`` windowed sound pressure.
        noise_power: Expected squared magnitude of the receiver's own noise; it is added to the
            squared magnitude of each bin.

    Returns:
        ``(..., 250)`` float32, at least -8.
    """
    magnitude = np.abs(scipy.fft.rfft(samples)[..., :N_BINS])
    if noise_power > 0.0:
        magnitude = np.sqrt(magnitude**2 + np.float32(noise_power))
    spectrum = np.log10(magnitude + np.float32(MAGNITUDE_FLOOR))
    # the float32 logarithm of the floor may round to just below the lower bound of the spec
    observation: NDArray[np.float32] = np.maximum(spectrum, np.float32(SILENCE))
    return observation
