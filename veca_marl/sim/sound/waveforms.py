"""Waveforms: synthesised harmonic sounds, WAV files, and the calls of agents.

The level of a sound is its rms pressure at 1 m in an arbitrary unit; 1.0 is the full scale of a WAV
file. Read as pascals, 1.0 is 94 dB SPL (20 micropascals are 0 dB). No sound contains frequencies
well below `HIGH_PASS_HZ`: noise, voices and WAV files are high-passed, buzzes and tones have no
lower pitch. Real sources emit no constant pressure, and image sources with positive reflection
coefficients would accumulate it (Allen & Berkley 1979 filter the response of the room in the same
way).

A call is a glide of a harmonic voice from one pitch to another. The calls differ in pitch and in
the direction of the glide. Their meaning is not given: it has to be learnt.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cache
from pathlib import Path

import numpy as np
import scipy.io.wavfile
import scipy.signal
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats

SAMPLE_RATE_HZ = 22_050
"""Sampling rate of all sound in a world."""

LOUDEST = 1e6
"""Greatest level and sample of a sound, beyond any and far from the limits of float32."""

HIGH_PASS_HZ = 80.0
# the high-pass decays by 120 dB within 40 ms
_SETTLING_S = 0.05
_LOWEST_PITCH_HZ = 80.0
_BUZZ_SLOPE = -0.5
_BUZZ_TOP = 0.9

Samples = NDArray[np.float32]

# of calls
_HARMONICS = 8
_TILT = -1.0  # amplitude falls by 6 dB per octave, as a voice at the lips does (Fant 1960)
_FADE_S = 0.01


def tone(frequency_hz: float, level: float, sample_rate_hz: float) -> Samples:
    """Return one second of a pure tone; the frequency is rounded to whole hertz for looping."""
    return _harmonics(check_pitch(frequency_hz, sample_rate_hz), 1, level, int(sample_rate_hz))


def buzz(frequency_hz: float, level: float, sample_rate_hz: float) -> Samples:
    """Return one second of all harmonics up to 0.9 of the Nyquist frequency, -3 dB per octave.

    It is broadband, so that the spectral cues of head and pinna are present up to the highest
    frequency of the observation (5.4 kHz). The frequency is rounded to whole hertz for looping.
    """
    pitch = check_pitch(frequency_hz, sample_rate_hz)
    n_harmonics = max(1, int(_BUZZ_TOP * sample_rate_hz / 2.0 / pitch))
    return _harmonics(pitch, n_harmonics, level, int(sample_rate_hz))


@cache
def _harmonics(frequency_hz: int, n_harmonics: int, level: float, sample_rate_hz: int) -> Samples:
    """Return one second, with phases of low peak factor (Schroeder 1970, eq. 11)."""
    spectrum = np.zeros(sample_rate_hz // 2 + 1, np.complex128)
    order = np.arange(1, n_harmonics + 1)
    phase = -np.pi * order * (order - 1) / n_harmonics
    spectrum[order * frequency_hz] = order**_BUZZ_SLOPE * np.exp(1j * phase)
    samples = np.fft.irfft(spectrum, sample_rate_hz)
    samples *= check_level(level) / np.sqrt(np.mean(samples**2))
    emitted: Samples = samples.astype(np.float32)
    emitted.setflags(write=False)
    return emitted


def load_wav(
    path: str | Path, sample_rate_hz: int, level: float | None = None, loop: bool = False
) -> Samples:
    """Read a WAV file as one channel ``(n,)`` at the rate of the sound field, high-passed.

    Args:
        path: The file: integers of 8 to 32 bits, or floats.
        sample_rate_hz: Rate of the result.
        level: Rms pressure at 1 m to scale to; None keeps the file's own (full scale is 1).
        loop: Whether it is to be repeated: the high-pass then begins in its periodic state, so
            that there is no transient at the seam.

    Raises:
        ValueError: If the file cannot be read as a WAV file, has no samples, samples that are not
            finite, or is silent and a level is given.
    """
    try:
        rate, samples = scipy.io.wavfile.read(path)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}; give the path of a WAV file") from error
    except (ValueError, struct.error) as error:
        raise ValueError(f"{path}: cannot be read as a WAV file ({error})") from error
    if samples.size == 0:
        raise ValueError(f"{path}: has no samples")
    mono = _full_scale(samples)
    if not np.isfinite(mono).all():
        raise ValueError(f"{path}: has samples that are not finite")
    if mono.ndim == 2:
        mono = mono.mean(axis=1)
    filtered = _high_passed(_resampled(mono, rate, sample_rate_hz, loop), sample_rate_hz, loop)
    if level is not None:
        rms = np.sqrt(np.mean(filtered**2))
        if rms == 0.0:
            raise ValueError(f"{path}: is silent and cannot be scaled to level {level}")
        filtered = filtered * (check_level(level) / rms)
    waveform: Samples = filtered.astype(np.float32)
    return waveform


def _resampled(samples: Floats, rate_hz: int, sample_rate_hz: int, loop: bool) -> Floats:
    """Return samples at another rate; a loop is taken as periodic, other clips end in silence."""
    if rate_hz == sample_rate_hz:
        return samples
    if loop:
        number = max(1, round(samples.size * sample_rate_hz / rate_hz))
        periodic: Floats = scipy.signal.resample(samples, number)
        return periodic
    common = math.gcd(rate_hz, sample_rate_hz)
    clip: Floats = scipy.signal.resample_poly(samples, sample_rate_hz // common, rate_hz // common)
    return clip


def _high_passed(samples: Floats, sample_rate_hz: int, loop: bool) -> Floats:
    """Return samples ``(n,)`` after the high-pass; for a loop, after earlier repetitions."""
    earlier = math.ceil(_SETTLING_S * sample_rate_hz / samples.size) if loop else 0
    repeated = np.tile(samples, 1 + earlier)
    filtered: Floats = scipy.signal.sosfilt(high_pass(sample_rate_hz), repeated)
    return filtered[-samples.size :]


def _full_scale(samples: NDArray[np.generic]) -> Floats:
    """Return samples in [-1, 1]; 8-bit WAV files are unsigned."""
    values: Floats = samples.astype(np.float64)
    if samples.dtype.kind == "u":
        return (values - 128.0) / 128.0
    if samples.dtype.kind == "i":
        return values / 2.0 ** (8 * samples.dtype.itemsize - 1)
    return values


@cache
def high_pass(sample_rate_hz: float) -> Floats:
    """Return the second-order sections of the high-pass of all sounds (Butterworth, order 2)."""
    sections: Floats = scipy.signal.butter(
        2, HIGH_PASS_HZ, "highpass", fs=sample_rate_hz, output="sos"
    )
    return sections


def check_level(level: float) -> float:
    """Return the level, or raise `ValueError` if it is not in [0, 1e6]; see `LOUDEST`."""
    if not 0.0 <= level <= LOUDEST:
        raise ValueError(f"level must be finite and not negative, at most {LOUDEST:g}, got {level}")
    return level


def check_waveform(waveform: ArrayLike) -> Floats:
    """Return a copy of samples ``(n,)``.

    Raises:
        ValueError: If they have another shape, or a number is not finite or above `LOUDEST`.
    """
    samples = np.array(waveform, dtype=np.float64)
    # false for numbers that are not finite
    if samples.ndim != 1 or not (np.abs(samples) <= LOUDEST).all():
        raise ValueError(
            f"a waveform must be (n,) finite numbers of at most {LOUDEST:g}, got shape "
            f"{samples.shape}"
        )
    return samples


def check_pitch(frequency_hz: float, sample_rate_hz: float, name: str = "frequency_hz") -> int:
    """Return the frequency in whole hertz.

    Raises:
        ValueError: If it is below 80 or not below half of the sampling rate.
    """
    is_pitch = np.isfinite(frequency_hz) and frequency_hz >= _LOWEST_PITCH_HZ
    if not is_pitch or round(frequency_hz) >= sample_rate_hz / 2.0:
        raise ValueError(
            f"{name}={frequency_hz} must be at least {_LOWEST_PITCH_HZ} and below "
            f"{sample_rate_hz / 2.0}, half of the sampling rate"
        )
    return round(frequency_hz)


@dataclass(frozen=True)
class CallCfg:
    """One call as data.

    Attributes:
        begin_hz: Pitch at its beginning, at least 80 and below 11 025, half of the sampling rate.
        end_hz: Pitch at its end.
        length_s: Duration, above 0.02 and at most 5.
        level: Rms pressure at 1 m, in the middle of the call; see `waveforms`.
    """

    begin_hz: float
    end_hz: float
    length_s: float = 0.2
    level: float = 0.1

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_pitch(self.begin_hz, SAMPLE_RATE_HZ, "begin_hz")
        check_pitch(self.end_hz, SAMPLE_RATE_HZ, "end_hz")
        check_level(self.level)
        if not 2.0 * _FADE_S < self.length_s <= 5.0:
            raise ValueError(f"length_s={self.length_s} must be above {2.0 * _FADE_S}, at most 5")

    def pitched(self, factor: float) -> CallCfg:
        """Return the call of a voice whose frequencies are higher by a factor."""
        if factor == 1.0:
            return self
        return replace(self, begin_hz=factor * self.begin_hz, end_hz=factor * self.end_hz)


class Call(IntEnum):
    """The calls; their numbers are those of the action."""

    none = 0
    low = 1
    high = 2
    rising = 3
    falling = 4


CALLS: dict[Call, CallCfg] = {
    # an infant's cry lies at 400 to 600 Hz (Wasz-Hoeckert et al. 1968); an octave about it
    Call.low: CallCfg(300.0, 300.0),
    Call.high: CallCfg(600.0, 600.0),
    Call.rising: CallCfg(300.0, 600.0),
    Call.falling: CallCfg(600.0, 300.0),
}


@cache
def call_waveform(cfg: CallCfg, sample_rate_hz: int) -> Samples:
    """Return the samples of a call ``(n,)``, read-only and cached.

    The pitch changes exponentially in time (evenly on a musical scale); the phase is its integral.
    """
    n = round(cfg.length_s * sample_rate_hz)
    share = np.arange(n) / n
    pitch_hz = cfg.begin_hz * (cfg.end_hz / cfg.begin_hz) ** share
    phase = 2.0 * np.pi * np.cumsum(pitch_hz) / sample_rate_hz
    order = np.arange(1, _HARMONICS + 1)
    audible = order[:, None] * pitch_hz < 0.45 * sample_rate_hz
    audible[0] = True  # the fundamental, which is below half of the rate
    voice = (np.sin(order[:, None] * phase) * audible * order[:, None] ** _TILT).sum(axis=0)
    voice *= cfg.level / max(float(np.sqrt(np.mean(voice**2))), 1e-12)
    edge_s = np.minimum(np.arange(n), np.arange(n)[::-1]) / sample_rate_hz
    samples: Samples = (voice * np.clip(edge_s / _FADE_S, 0.0, 1.0)).astype(np.float32)
    samples.setflags(write=False)
    return samples
