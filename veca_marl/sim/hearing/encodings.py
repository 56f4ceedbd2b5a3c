"""What an observation contains of the sound at two ears: spectra, interaural phases, or samples."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from veca_marl.sim.hearing.infant_hearing import threshold_powers
from veca_marl.sim.sense import ArraySpec
from veca_marl.sim.sound import SAMPLE_RATE_HZ

WINDOW_SAMPLES = 1024
N_BINS = 250
"""Bins in the paper's code."""

MOST_BINS = WINDOW_SAMPLES // 2 + 1
"""All bins of the Fourier transform, up to half the sampling rate."""

MAGNITUDE_FLOOR = 1e-8
"""Added to each magnitude before the logarithm, as in the paper's code."""

SILENCE = -8.0
"""``log10(MAGNITUDE_FLOOR)``, the observed value of exact silence."""

Samples = NDArray[np.float32]
Noise = float | Samples
"""Squared magnitude of a receiver's own noise, of all bins or ``(bins,)``."""


class Window(Enum):
    """Weights of the samples before the Fourier transform; the paper's is rectangular."""

    rectangular = "rectangular"
    hann = "hann"


def window_weights(window: Window) -> Samples:
    """Return the ``(1024,)`` weights of a window (Hann: periodic, as for spectral analysis)."""
    if window is Window.hann:
        return np.hanning(WINDOW_SAMPLES + 1)[:-1].astype(np.float32)
    return np.ones(WINDOW_SAMPLES, np.float32)


def noise_power(noise_floor_db: float | None, weights: Samples) -> float:
    """Return the expected squared magnitude of white noise in one bin.

    Args:
        noise_floor_db: Level of the noise relative to an rms pressure of 1; None for no noise.
        weights: ``(1024,)`` weights of the window.
    """
    if noise_floor_db is None:
        return 0.0
    return float(10.0 ** (noise_floor_db / 10.0) * (weights**2).sum())


def log_spectrum(samples: Samples, noise_power: Noise = 0.0, bins: int = N_BINS) -> Samples:
    """Return ``log10(|rfft(samples)| + 1e-8)`` of the first bins.

    Args:
        samples: ``(..., 1024)`` windowed sound pressure.
        noise_power: Expected squared magnitude of the receiver's own noise, of all bins or
            ``(bins,)``; it is added to the squared magnitude of each bin.
        bins: Number of bins, at most 513.

    Returns:
        ``(..., bins)`` float32, at least -8.
    """
    return _log_magnitudes(scipy.fft.rfft(samples)[..., :bins], noise_power)


def _log_magnitudes(spectrum: NDArray[np.complex64], noise_power: Noise) -> Samples:
    magnitude = np.abs(spectrum)
    if not isinstance(noise_power, float) or noise_power > 0.0:
        magnitude = np.sqrt(magnitude**2 + np.float32(noise_power))
    logarithm = np.log10(magnitude + np.float32(MAGNITUDE_FLOOR))
    # the float32 logarithm of the floor may round to just below the lower bound of the spec
    observation: Samples = np.maximum(logarithm, np.float32(SILENCE))
    return observation


PHASE_LIMIT_HZ = 1400.0
"""Frequency at which the weight of the interaural phase is a half. People do not perceive
differences of phase above it (Brughera, Dunai & Hartmann 2013, J. Acoust. Soc. Am. 133, 2839)."""

_PHASE_SLOPE = 4


def interaural_phase(spectrum: NDArray[np.complex64], noise_power: Noise = 0.0) -> Samples:
    """Return cosine and sine of the phase of the left ear relative to the right one.

    With a source on the left the left ear is ahead: the sine is positive at low frequencies. Both
    are weighted by ``|L R| / (|L R| + noise_power + 1e-16)``, which is 1 where the bin has energy
    and 0 in silence, where there is no phase; and by ``1 / (1 + (f / PHASE_LIMIT_HZ) ** 4)``. At
    high frequencies the head is several wavelengths wide: the phase is ambiguous and, in a room,
    almost random, and networks learnt to localise more slowly where it was not left out.

    Args:
        spectrum: ``(2, bins)`` complex spectra of the ears at 22 050 Hz, left first.
        noise_power: See `log_spectrum`.

    Returns:
        ``(2, bins)`` float32 in [-1, 1]: cosine, sine.
    """
    # double precision: the product of two faint bins is below the range of float32
    product = spectrum[0].astype(np.complex128) * spectrum[1].conj()
    hertz = np.arange(product.size) * (SAMPLE_RATE_HZ / WINDOW_SAMPLES)
    followed = 1.0 / (1.0 + (hertz / PHASE_LIMIT_HZ) ** _PHASE_SLOPE)
    weighted = product * followed / (np.abs(product) + noise_power + MAGNITUDE_FLOOR**2)
    return np.stack([weighted.real, weighted.imag]).astype(np.float32)


class Encoding(Enum):
    """What the observation ``audio`` contains of the last 1024 samples at the ears.

    Attributes:
        magnitude: ``(2, bins)``: log10 of the magnitude of each bin, the formula of the paper's
            code. The time between the ears is not in it.
        magnitude_phase: ``(4, bins)``: the same, then cosine and sine of the interaural phase, see
            `interaural_phase`. It has what the paper names, "the time and impulse difference".
        waveform: ``(2, 1024)``: the samples themselves, without the weights of the window.
    """

    magnitude = "magnitude"
    magnitude_phase = "magnitude_phase"
    waveform = "waveform"


class Encoder(Protocol):
    """Computes an observation from the last samples at the ears."""

    @property
    def noise_power(self) -> Noise:
        """See `log_spectrum`."""
        ...

    @property
    def spec(self) -> ArraySpec:
        """The spec of the observation."""
        ...

    def encode(self, samples: Samples) -> Samples:
        """Return the observation of ``(2, 1024)`` samples, left ear first."""
        ...

    def log_magnitudes(self, observation: NDArray[Any]) -> NDArray[Any]:
        """Return the log10 of the magnitudes of both ears in an observation, ``(2, bins)``."""
        ...


@dataclass(frozen=True)
class MagnitudeEncoder:
    """See `Encoding.magnitude`.

    Attributes:
        weights: ``(1024,)`` weights of the window.
        noise_power: See `log_spectrum`.
        bins: Number of bins.
    """

    weights: Samples = field(repr=False)
    noise_power: Noise
    bins: int

    @property
    def spec(self) -> ArraySpec:
        """See `Encoder`."""
        return ArraySpec((2, self.bins), np.float32, low=SILENCE)

    def encode(self, samples: Samples) -> Samples:
        """See `Encoder`."""
        return log_spectrum(samples * self.weights, self.noise_power, self.bins)

    def log_magnitudes(self, observation: NDArray[Any]) -> NDArray[Any]:
        """See `Encoder`."""
        return observation


@dataclass(frozen=True)
class PhaseEncoder(MagnitudeEncoder):
    """See `Encoding.magnitude_phase`."""

    @property
    def spec(self) -> ArraySpec:
        """See `Encoder`."""
        return ArraySpec((4, self.bins), np.float32, low=SILENCE)

    def encode(self, samples: Samples) -> Samples:
        """See `Encoder`."""
        spectrum = scipy.fft.rfft(samples * self.weights)[:, : self.bins]
        magnitudes = _log_magnitudes(spectrum, self.noise_power)
        return np.concatenate([magnitudes, interaural_phase(spectrum, self.noise_power)])

    def log_magnitudes(self, observation: NDArray[Any]) -> NDArray[Any]:
        """See `Encoder`."""
        return observation[:2]


@dataclass(frozen=True)
class WaveformEncoder(MagnitudeEncoder):
    """See `Encoding.waveform`; the attributes serve `log_magnitudes` only."""

    @property
    def spec(self) -> ArraySpec:
        """See `Encoder`."""
        return ArraySpec((2, WINDOW_SAMPLES), np.float32)

    def encode(self, samples: Samples) -> Samples:
        """See `Encoder`."""
        return samples.copy()

    def log_magnitudes(self, observation: NDArray[Any]) -> NDArray[Any]:
        """See `Encoder`."""
        return log_spectrum(observation * self.weights, self.noise_power, self.bins)


_ENCODERS = {
    Encoding.magnitude: MagnitudeEncoder,
    Encoding.magnitude_phase: PhaseEncoder,
    Encoding.waveform: WaveformEncoder,
}


def make_encoder(
    encoding: Encoding,
    window: Window,
    noise_db: float | None,
    bins: int,
    age_months: float | None = None,
) -> Encoder:
    """Construct the encoder of an encoding.

    Args:
        encoding: See `Encoding`.
        window: See `Window`.
        noise_db: Level of the receiver's own noise, see `noise_power`.
        bins: Number of bins.
        age_months: Age by which the noise has the thresholds of hearing too; None for none.
    """
    weights = window_weights(window)
    noise: Noise = noise_power(noise_db, weights)
    if age_months is not None:
        noise = noise + threshold_powers(age_months, weights, SAMPLE_RATE_HZ, bins)
    return _ENCODERS[encoding](weights, noise, bins)
