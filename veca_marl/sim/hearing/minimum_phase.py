"""Minimum-phase impulse responses of given magnitudes."""

from __future__ import annotations

import numpy as np
import scipy.fft
from numpy.typing import NDArray

_MIN_MAGNITUDE = 1e-6


def minimum_phase(magnitude: NDArray[np.floating], n_taps: int) -> NDArray[np.floating]:
    """Return the minimum-phase impulse response of a magnitude response.

    Folds the real cepstrum (Oppenheim & Schafer 2010, section 13.5).

    Args:
        magnitude: ``(..., n_fft / 2 + 1)`` magnitudes from 0 Hz to the Nyquist frequency.
        n_taps: Length of the response.

    Returns:
        ``(..., n_taps)`` of the magnitude's dtype.
    """
    n_fft = 2 * (magnitude.shape[-1] - 1)
    cepstrum = scipy.fft.irfft(np.log(np.maximum(magnitude, _MIN_MAGNITUDE)), n_fft)
    cepstrum[..., 1 : n_fft // 2] *= 2.0
    cepstrum[..., n_fft // 2 + 1 :] = 0.0
    response: NDArray[np.floating] = scipy.fft.irfft(np.exp(scipy.fft.rfft(cepstrum)), n_fft)
    return response[..., :n_taps]
