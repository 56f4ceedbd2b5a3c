"""Compact head-related impulse responses: minimum-phase filters and arrival times per direction."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

_CEPSTRUM_FLOOR = 1e-6  # least magnitude of which `minimum_phase` takes the logarithm

SMALLEST_SCALE, LARGEST_SCALE = 0.5, 1.5
"""Range of scales; the head circumference of a newborn is about 0.6 of an adult's."""

_N_FFT = 2048
_MIN_MAGNITUDE = 1e-5


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
    cepstrum = scipy.fft.irfft(np.log(np.maximum(magnitude, _CEPSTRUM_FLOOR)), n_fft)
    cepstrum[..., 1 : n_fft // 2] *= 2.0
    cepstrum[..., n_fft // 2 + 1 :] = 0.0
    response: NDArray[np.floating] = scipy.fft.irfft(np.exp(scipy.fft.rfft(cepstrum)), n_fft)
    return response[..., :n_taps]


@dataclass(frozen=True)
class HeadResponse:
    """The response of a head to a source at one distance, per measured direction and ear.

    The arrival time is kept apart from the filter, so that neither interpolation between
    directions nor movement causes comb filtering. That minimum phase plus a pure delay cannot be
    told from the measured response is the finding of Kulkarni, Isabelle & Colburn (1999).

    Attributes:
        directions: ``(M, 3)`` unit vectors to the source in the head frame.
        filters: ``(M, 2, T)`` float32 minimum-phase impulse responses, left ear first; their gain
            at low frequency is that of the measurement, about 1.
        arrival_s: ``(M, 2)`` seconds relative to the arrival at the centre of the absent head;
            negative at the ear on the side of the source.
        sample_rate_hz: Sampling rate of the filters.
        head_radius_m: Radius of the sphere, the arrival times of which fit best.
        measured_at_m: Distance of the loudspeaker from the centre of the head.
        licence: Terms and authors of the measurement.
    """

    directions: Floats
    filters: NDArray[np.float32]
    arrival_s: Floats
    sample_rate_hz: int
    head_radius_m: float
    measured_at_m: float
    licence: str

    def scaled(self, scale: float) -> HeadResponse:
        """Return the response of a head of another size with the same shape.

        In a medium without losses the wave equation is unchanged if all lengths and times are
        multiplied by the same number: a feature of the spectrum at frequency f moves to
        ``f / scale``, delays become ``scale`` times as long. Middlebrooks (1999) scales the
        responses of one person in this way to resemble those of another.

        Where a scale above 1 needs magnitudes above half of the sampling rate, the last one below
        it is used.

        Args:
            scale: Size relative to this head, see `check_scale`; 1 returns the object itself.

        Raises:
            ValueError: If the scale is out of range.
        """
        if check_scale(scale) == 1.0:
            return self
        # the response of a larger head is as much longer
        n_taps = math.ceil(self.filters.shape[-1] * max(1.0, scale))
        magnitude = np.abs(np.fft.rfft(self.filters, _N_FFT))
        log_magnitude = np.log(np.maximum(magnitude, _MIN_MAGNITUDE))
        bins: Floats = np.arange(magnitude.shape[-1], dtype=np.float64)
        moved = np.exp(_read_rows(log_magnitude, np.multiply(scale, bins)))
        return replace(
            self,
            filters=minimum_phase(moved, n_taps).astype(np.float32),
            arrival_s=scale * self.arrival_s,
            head_radius_m=scale * self.head_radius_m,
            measured_at_m=scale * self.measured_at_m,
        )

    def save(self, path: str | Path) -> None:
        """Write an ``.npz`` file with filters in half precision (rounding error below -66 dB)."""
        np.savez_compressed(
            path,
            directions=self.directions.astype(np.float32),
            filters=self.filters.astype(np.float16),
            arrival_s=self.arrival_s.astype(np.float32),
            sample_rate_hz=self.sample_rate_hz,
            head_radius_m=self.head_radius_m,
            measured_at_m=self.measured_at_m,
            licence=self.licence,
        )

    @staticmethod
    def load(path: str | Path) -> HeadResponse:
        """Read a file that `save` wrote."""
        with np.load(path, allow_pickle=False) as file:
            return HeadResponse(
                directions=file["directions"].astype(np.float64),
                filters=file["filters"].astype(np.float32),
                arrival_s=file["arrival_s"].astype(np.float64),
                sample_rate_hz=int(file["sample_rate_hz"]),
                head_radius_m=float(file["head_radius_m"]),
                measured_at_m=float(file["measured_at_m"]),
                licence=str(file["licence"]),
            )


def check_scale(scale: float) -> float:
    """Return the scale of a head, or raise `ValueError` if it is not in [0.5, 1.5]."""
    if not SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        raise ValueError(
            f"head_scale={scale} must be from {SMALLEST_SCALE} to {LARGEST_SCALE}; 1 is the "
            "measured head"
        )
    return float(scale)


def _read_rows(rows: Floats, positions: Floats) -> Floats:
    """Interpolate linearly along the last axis; beyond the last column, return the last."""
    clipped = np.minimum(positions, rows.shape[-1] - 1)
    below = np.minimum(clipped.astype(np.int64), rows.shape[-1] - 2)
    share = clipped - below
    read: Floats = rows[..., below] * (1.0 - share) + rows[..., below + 1] * share
    return read
