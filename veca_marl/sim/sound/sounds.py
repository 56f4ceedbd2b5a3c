"""What sources emit, sample by sample, and sounds as data. Levels are those of `waveforms`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
import scipy.signal
from numpy.typing import ArrayLike

from veca_marl.sim.sound.waveforms import (
    Samples,
    buzz,
    check_level,
    check_pitch,
    high_pass,
    load_wav,
    tone,
)


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
        """Take a waveform ``(n,)`` that is at its level already; see `waveforms`.

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
        self.level = check_level(level)
        self._high_pass = high_pass(sample_rate_hz)
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
        self._high_pass = high_pass(sample_rate_hz)
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

    @property
    def speaking(self) -> bool:
        """Whether something is still to be said."""
        return bool(self._queue)

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
        check_pitch(self.frequency_hz)
        check_level(self.level)
        if (self.path is None) == (self.kind is SoundKind.clip):
            raise ValueError(f"a clip needs a path and nothing else does: {self.kind}, {self.path}")


def make_sound(cfg: SoundCfg, sample_rate_hz: int = 22_050) -> Sound:
    """Return a new sound with its own state."""
    makers: dict[SoundKind, Callable[[], Sound]] = {
        SoundKind.buzz: lambda: Clip(buzz(cfg.frequency_hz, cfg.level, sample_rate_hz), loop=True),
        SoundKind.tone: lambda: Clip(tone(cfg.frequency_hz, cfg.level, sample_rate_hz), loop=True),
        SoundKind.noise: lambda: Noise(cfg.level, sample_rate_hz),
        SoundKind.clip: lambda: Clip(
            load_wav(str(cfg.path), sample_rate_hz, cfg.level), loop=cfg.loop
        ),
        SoundKind.voice: lambda: Voice(sample_rate_hz),
        SoundKind.silence: Silence,
    }
    return makers[cfg.kind]()
