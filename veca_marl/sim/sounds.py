"""What sources emit. The level of a sound is its rms pressure at 1 m; 1.0 is a free choice of unit.

A loudspeaker, a mouth or a ball emits no steady pressure, and image sources with positive
reflection coefficients would pile it up: every sound is high-passed at `HIGH_PASS_HZ` (Allen &
Berkley 1979 do the same to the response of the room).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cache
from math import gcd
from pathlib import Path
from typing import Protocol

import numpy as np
import scipy.io.wavfile
import scipy.signal
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.pose import Floats

HIGH_PASS_HZ = 80.0
_LOWEST_PITCH_HZ = 80.0
_BUZZ_SLOPE = -0.5
_BUZZ_TOP = 0.9

Samples = NDArray[np.float32]


class Sound(Protocol):
    """A stream of samples."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew; whatever is random about the sound is drawn here."""
        ...

    def emit(self, n_samples: int) -> Samples:
        """Return the next samples ``(n,)`` float32. The caller does not write into them."""
        ...


class Silence:
    """No sound: exactly zero."""

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        return np.zeros(n_samples, np.float32)


class Clip:
    """A recorded waveform, once or for ever."""

    def __init__(self, waveform: ArrayLike, loop: bool = False) -> None:
        """Take a waveform ``(n,)`` that is at its level already; see `load_wav`, `buzz`, `tone`.

        Args:
            waveform: Samples at the rate of the sound field.
            loop: Repeat for ever, from a random place on; else play once from the beginning.
        """
        self.waveform = np.asarray(waveform, dtype=np.float32)
        if self.waveform.ndim != 1 or self.waveform.size == 0:
            raise ValueError(f"a waveform must be (n,), got {self.waveform.shape}")
        if not np.isfinite(self.waveform).all():
            raise ValueError("a waveform must be finite")
        self.loop = loop
        self._position = 0

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self._position = int(rng.integers(self.waveform.size)) if self.loop else 0

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        begin = self._position
        self._position += n_samples
        if self.loop:
            self._position %= self.waveform.size
            if begin + n_samples <= self.waveform.size:
                return self.waveform[begin : begin + n_samples]
            return np.take(self.waveform, np.arange(begin, begin + n_samples), mode="wrap")
        rest = self.waveform[begin : begin + n_samples]
        return rest if rest.size == n_samples else np.pad(rest, (0, n_samples - rest.size))


class Noise:
    """White Gaussian noise, drawn anew for every sample."""

    def __init__(self, level: float, sample_rate_hz: float) -> None:
        self.level = _checked_level(level)
        self._high_pass = _high_pass(sample_rate_hz)
        self._rng: np.random.Generator | None = None
        self._state = np.zeros((self._high_pass.shape[0], 2))

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self._rng = np.random.default_rng(rng.integers(2**63))
        self._state[:] = 0.0

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        if self._rng is None:
            raise RuntimeError("reset the noise before it emits: it has no random numbers yet")
        white = self._rng.standard_normal(n_samples) * self.level
        filtered, self._state = scipy.signal.sosfilt(self._high_pass, white, zi=self._state)
        emitted: Samples = filtered.astype(np.float32)
        return emitted


class Voice:
    """A mouth: silent until it is told what to say; utterances queue up."""

    def __init__(self, sample_rate_hz: float = 22_050) -> None:
        self._high_pass = _high_pass(sample_rate_hz)
        self._queue: deque[Samples] = deque()

    def say(self, waveform: ArrayLike) -> None:
        """Append a waveform ``(n,)`` in rms pressure at 1 m, at the sound field's rate.

        Raises:
            ValueError: If it is not one-dimensional or not finite.
        """
        samples = np.asarray(waveform, dtype=np.float64)
        if samples.ndim != 1 or not np.isfinite(samples).all():
            raise ValueError(f"a waveform must be (n,) finite numbers, got {samples.shape}")
        if samples.size:
            filtered = scipy.signal.sosfilt(self._high_pass, samples)
            self._queue.append(filtered.astype(np.float32))

    def hush(self) -> None:
        """Forget what was not said yet."""
        self._queue.clear()

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self.hush()

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        emitted = np.zeros(n_samples, np.float32)
        begin = 0
        while self._queue and begin < n_samples:
            utterance = self._queue.popleft()
            taken = min(utterance.size, n_samples - begin)
            emitted[begin : begin + taken] = utterance[:taken]
            begin += taken
            if taken < utterance.size:
                self._queue.appendleft(utterance[taken:])
        return emitted


def tone(frequency_hz: float, level: float, sample_rate_hz: float) -> Clip:
    """Return a pure tone. Its frequency is rounded to whole hertz, so that one second closes."""
    return Clip(_harmonics(_checked_pitch(frequency_hz), 1, level, int(sample_rate_hz)), loop=True)


def buzz(frequency_hz: float, level: float, sample_rate_hz: float) -> Clip:
    """Return a buzz: all harmonics up to 0.9 of the Nyquist frequency, falling 3 dB per octave.

    Broadband, so that the head and the pinna have something to colour up to the top of the
    observation (5.4 kHz). The frequency is rounded to whole hertz, so that one second closes.
    """
    pitch = _checked_pitch(frequency_hz)
    n_harmonics = max(1, int(_BUZZ_TOP * sample_rate_hz / 2.0 / pitch))
    return Clip(_harmonics(pitch, n_harmonics, level, int(sample_rate_hz)), loop=True)


@cache
def _harmonics(frequency_hz: int, n_harmonics: int, level: float, sample_rate_hz: int) -> Samples:
    """Return one second, with the phases that keep the peaks low (Schroeder 1970, eq. 11)."""
    if frequency_hz * n_harmonics >= sample_rate_hz / 2:
        raise ValueError(f"{frequency_hz} Hz does not fit below half of {sample_rate_hz} Hz")
    spectrum = np.zeros(sample_rate_hz // 2 + 1, np.complex128)
    order = np.arange(1, n_harmonics + 1)
    phase = -np.pi * order * (order - 1) / n_harmonics
    spectrum[order * frequency_hz] = order**_BUZZ_SLOPE * np.exp(1j * phase)
    samples = np.fft.irfft(spectrum, sample_rate_hz)
    samples *= _checked_level(level) / np.sqrt(np.mean(samples**2))
    emitted: Samples = samples.astype(np.float32)
    emitted.setflags(write=False)
    return emitted


def load_wav(path: str | Path, sample_rate_hz: int, level: float | None = None) -> Samples:
    """Read a WAV file as one channel ``(n,)`` at the rate of the sound field, high-passed.

    Args:
        path: The file: integers of 8 to 32 bits, or floats.
        sample_rate_hz: Rate of the result.
        level: Rms pressure at 1 m to scale to; None keeps the file's own (full scale is 1).

    Raises:
        ValueError: If the file is no WAV file, or silent although a level is wanted.
    """
    try:
        rate, samples = scipy.io.wavfile.read(path)
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read as a WAV file ({error})") from error
    mono = _full_scale(samples)
    if mono.ndim == 2:
        mono = mono.mean(axis=1)
    common = gcd(rate, sample_rate_hz)
    resampled = scipy.signal.resample_poly(mono, sample_rate_hz // common, rate // common)
    filtered = scipy.signal.sosfilt(_high_pass(sample_rate_hz), resampled)
    if level is not None:
        rms = np.sqrt(np.mean(filtered**2))
        if rms == 0.0:
            raise ValueError(f"{path}: is silent and cannot be scaled to level {level}")
        filtered = filtered * (_checked_level(level) / rms)
    waveform: Samples = filtered.astype(np.float32)
    return waveform


def _full_scale(samples: NDArray[np.generic]) -> Floats:
    """Return samples in [-1, 1]; 8-bit WAV files are unsigned."""
    values: Floats = samples.astype(np.float64)
    if samples.dtype.kind == "u":
        return (values - 128.0) / 128.0
    if samples.dtype.kind == "i":
        return values / 2.0 ** (8 * samples.dtype.itemsize - 1)
    return values


@cache
def _high_pass(sample_rate_hz: float) -> Floats:
    sections: Floats = scipy.signal.butter(
        2, HIGH_PASS_HZ, "highpass", fs=sample_rate_hz, output="sos"
    )
    return sections


def _checked_level(level: float) -> float:
    if not (np.isfinite(level) and level >= 0.0):
        raise ValueError(f"level must be finite and not negative, got {level}")
    return level


def _checked_pitch(frequency_hz: float) -> int:
    if not (np.isfinite(frequency_hz) and frequency_hz >= _LOWEST_PITCH_HZ):
        raise ValueError(f"frequency_hz must be at least {_LOWEST_PITCH_HZ}, got {frequency_hz}")
    return round(frequency_hz)


class SoundKind(Enum):
    """What a source of the playground sounds like."""

    buzz = "buzz"
    tone = "tone"
    noise = "noise"
    clip = "clip"
    voice = "voice"
    silence = "silence"


@dataclass
class SoundCfg:
    """A sound as data.

    Attributes:
        kind: See `SoundKind`.
        frequency_hz: Fundamental of a buzz or a tone, at least 80.
        level: Rms pressure at 1 m. A voice and a clip without `rescale` bring their own.
        path: WAV file of a clip.
        loop: Whether a clip repeats for ever.
    """

    kind: SoundKind = SoundKind.buzz
    frequency_hz: float = 150.0
    level: float = 0.1
    path: str | None = None
    loop: bool = True

    def __post_init__(self) -> None:
        _checked_pitch(self.frequency_hz)
        _checked_level(self.level)
        if (self.path is None) == (self.kind is SoundKind.clip):
            raise ValueError(f"a clip needs a path and nothing else does: {self.kind}, {self.path}")


def make_sound(cfg: SoundCfg, sample_rate_hz: int = 22_050) -> Sound:
    """Return a new sound with its own state."""
    makers: dict[SoundKind, Callable[[], Sound]] = {
        SoundKind.buzz: lambda: buzz(cfg.frequency_hz, cfg.level, sample_rate_hz),
        SoundKind.tone: lambda: tone(cfg.frequency_hz, cfg.level, sample_rate_hz),
        SoundKind.noise: lambda: Noise(cfg.level, sample_rate_hz),
        SoundKind.clip: lambda: Clip(
            load_wav(str(cfg.path), sample_rate_hz, cfg.level), loop=cfg.loop
        ),
        SoundKind.voice: lambda: Voice(sample_rate_hz),
        SoundKind.silence: Silence,
    }
    return makers[cfg.kind]()
