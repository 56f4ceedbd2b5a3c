"""The sounds that sources emit, and their configuration. Levels are those of `waveforms`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
import scipy.signal
from numpy.typing import ArrayLike

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.waveforms import (
    SAMPLE_RATE_HZ,
    Samples,
    buzz,
    check_level,
    check_pitch,
    high_pass,
    load_wav,
    tone,
)

_NEGLIGIBLE = 1e-12  # pressure, -240 dB: the decay of the high-pass ends here


class Sound(Protocol):
    """A stream of samples."""

    def reset(self, rng: np.random.Generator) -> None:
        """Restart; everything random about the sound is drawn here."""
        ...

    def emit(self, n_samples: int) -> Samples:
        """Return the next samples ``(n,)`` float32, which the caller must not change."""
        ...


class Silence:
    """Exactly zero."""

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        return np.zeros(n_samples, np.float32)


class Clip:
    """A recorded waveform, played once or in a loop."""

    def __init__(self, waveform: ArrayLike, loop: bool = False) -> None:
        """Check and store the waveform.

        Args:
            waveform: ``(n,)`` rms pressure at 1 m, at the rate of the sound field; see `waveforms`.
            loop: Repeat without end from a random position on; else play once from the beginning.

        Raises:
            ValueError: If the waveform is empty, not finite or not one-dimensional.
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
    """White Gaussian noise, independent for every sample."""

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
            raise RuntimeError("reset() the noise before emit(): it has no random generator yet")
        white = self._rng.standard_normal(n_samples) * self.level
        filtered, self._state = scipy.signal.sosfilt(self._high_pass, white, zi=self._state)
        emitted: Samples = filtered.astype(np.float32)
        return emitted


class Voice:
    """A queue of utterances that are played one after the other, silence while it is empty.

    The high-pass runs over all that is emitted, silence included: a waveform that is passed to
    `say` in parts is emitted like the whole waveform, as long as the queue does not run empty.
    """

    def __init__(self, sample_rate_hz: float = SAMPLE_RATE_HZ) -> None:
        self._high_pass = high_pass(sample_rate_hz)
        self._state = np.zeros((self._high_pass.shape[0], 2))
        self._queue: deque[Floats] = deque()

    def say(self, waveform: ArrayLike) -> None:
        """Append a waveform ``(n,)`` in rms pressure at 1 m, at the sound field's rate.

        Raises:
            ValueError: If it is not one-dimensional or not finite.
        """
        samples = np.array(waveform, dtype=np.float64)
        if samples.ndim != 1 or not np.isfinite(samples).all():
            raise ValueError(f"a waveform must be (n,) finite numbers, got {samples.shape}")
        if samples.size:
            self._queue.append(samples)

    @property
    def speaking(self) -> bool:
        """Whether the queue is not empty."""
        return bool(self._queue)

    def clear(self) -> None:
        """Empty the queue; the response of the high-pass to earlier samples still decays."""
        self._queue.clear()

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self.clear()
        self._state[:] = 0.0

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        if not self._queue and not self._state.any():
            return np.zeros(n_samples, np.float32)
        filtered, self._state = scipy.signal.sosfilt(
            self._high_pass, self._take(n_samples), zi=self._state
        )
        if np.abs(self._state).max() < _NEGLIGIBLE:
            # exact silence: sources that emit zeros cost nothing
            self._state[:] = 0.0
        emitted: Samples = filtered.astype(np.float32)
        return emitted

    def _take(self, n_samples: int) -> Floats:
        """Remove up to ``n`` samples from the queue; return ``(n,)``, zeros after the last."""
        taken = np.zeros(n_samples)
        begin = 0
        while self._queue and begin < n_samples:
            utterance = self._queue.popleft()
            count = min(utterance.size, n_samples - begin)
            taken[begin : begin + count] = utterance[:count]
            begin += count
            if count < utterance.size:
                self._queue.appendleft(utterance[count:])
        return taken


class SoundKind(Enum):
    """Kinds of sounds."""

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
        kind: Kind of sound.
        frequency_hz: Fundamental of a buzz or a tone, at least 80 and below 11 025, half of the
            sampling rate.
        level: Rms pressure at 1 m; full scale of a WAV file is 1. Not used by a voice.
        path: WAV file of a clip.
        loop: Whether a clip repeats without end.
    """

    kind: SoundKind = SoundKind.buzz
    frequency_hz: float = 150.0
    level: float = 0.1
    path: str | None = None
    loop: bool = True

    def __post_init__(self) -> None:
        """Check the numbers, and that a clip and nothing else has a path."""
        check_pitch(self.frequency_hz, SAMPLE_RATE_HZ)
        check_level(self.level)
        if (self.path is None) == (self.kind is SoundKind.clip):
            raise ValueError(
                f"sound of kind {self.kind.value} with path={self.path!r}: a clip needs a path, "
                "other kinds must not have one"
            )


def make_sound(cfg: SoundCfg, sample_rate_hz: int = SAMPLE_RATE_HZ) -> Sound:
    """Return a new sound with its own state."""
    makers: dict[SoundKind, Callable[[], Sound]] = {
        SoundKind.buzz: lambda: Clip(buzz(cfg.frequency_hz, cfg.level, sample_rate_hz), loop=True),
        SoundKind.tone: lambda: Clip(tone(cfg.frequency_hz, cfg.level, sample_rate_hz), loop=True),
        SoundKind.noise: lambda: Noise(cfg.level, sample_rate_hz),
        SoundKind.clip: lambda: Clip(
            load_wav(str(cfg.path), sample_rate_hz, cfg.level, cfg.loop), loop=cfg.loop
        ),
        SoundKind.voice: lambda: Voice(sample_rate_hz),
        SoundKind.silence: Silence,
    }
    return makers[cfg.kind]()
