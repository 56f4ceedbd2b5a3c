"""Sounds, their configuration, and the sources that emit them. Levels are those of `waveforms`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound.signal_paths import SignalMemory
from veca_marl.sim.sound.waveforms import (
    SAMPLE_RATE_HZ,
    Samples,
    buzz,
    check_level,
    check_pitch,
    check_waveform,
    high_pass,
    load_wav,
    tone,
)

_RAMP_S = 0.005  # usual in psychoacoustics
_LONGEST_S = 60.0  # of pulses and pauses, which are stored
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
        samples = check_waveform(waveform)
        if samples.size == 0:
            raise ValueError("a waveform must have samples")
        self.waveform = samples.astype(np.float32)
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


class _HighPass:
    """The high-pass of all sounds, see `waveforms.high_pass`, over samples that come in parts.

    Attributes:
        state: ``(n_sections, 2)`` of the filter; all zeros if earlier samples are not heard.
    """

    def __init__(self, sample_rate_hz: float) -> None:
        self._sections = high_pass(sample_rate_hz)
        self.state = np.zeros((len(self._sections), 2))

    def __call__(self, samples: Floats) -> Samples:
        """Return the next samples ``(n,)``."""
        filtered = np.empty(samples.size, np.float32)
        _filter_sections(self._sections, samples, self.state, filtered)
        return filtered


@kernel
def _filter_sections(sections: Floats, samples: Floats, state: Floats, out: Samples) -> None:
    """Filter by a cascade of second-order sections, as `scipy.signal.sosfilt` does.

    Transposed direct form II. SciPy's function takes 70 us for the samples of a step, most of it
    checks of its arguments.

    Args:
        sections: ``(S, 6)`` coefficients b0, b1, b2, a0 = 1, a1, a2 of each section.
        samples: ``(n,)``.
        state: ``(S, 2)``, overwritten.
        out: ``(n,)``, overwritten.
    """
    for i in range(len(samples)):
        value = samples[i]
        for s in range(len(sections)):
            filtered = sections[s, 0] * value + state[s, 0]
            state[s, 0] = sections[s, 1] * value - sections[s, 4] * filtered + state[s, 1]
            state[s, 1] = sections[s, 2] * value - sections[s, 5] * filtered
            value = filtered
        out[i] = np.float32(value)


class Noise:
    """White Gaussian noise, independent for every sample."""

    def __init__(self, level: float, sample_rate_hz: float) -> None:
        self.level = check_level(level)
        self._high_pass = _HighPass(sample_rate_hz)
        self._rng: np.random.Generator | None = None

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self._rng = np.random.default_rng(rng.integers(2**63))
        self._high_pass.state[:] = 0.0

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        if self._rng is None:
            raise RuntimeError("reset() the noise before emit(): it has no random generator yet")
        return self._high_pass(self._rng.standard_normal(n_samples) * self.level)


class Pulses:
    """Another sound in pulses with silence between them, such as the beeps of an alarm.

    A pulse begins and ends with half of a period of a cosine: cutting a sound off would add clicks.

    Args:
        sound: The sound; it continues during the pauses, unheard.
        pulse_s: Duration of a pulse.
        pause_s: Duration of the silence after it.
        sample_rate_hz: Rate of the sound field.

    Raises:
        ValueError: If a duration is not positive or longer than a minute, or a pulse is shorter
            than its ramps, 10 ms.
    """

    def __init__(
        self, sound: Sound, pulse_s: float, pause_s: float, sample_rate_hz: float = SAMPLE_RATE_HZ
    ) -> None:
        check_pulses(pulse_s, pause_s)
        ramp = round(_RAMP_S * sample_rate_hz)
        rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp)
        level = np.ones(round(pulse_s * sample_rate_hz))
        level[:ramp], level[-ramp:] = rise, rise[::-1]
        pause = np.zeros(max(1, round(pause_s * sample_rate_hz)))
        self._sound = sound
        self._level = Clip(np.concatenate([level, pause]), loop=True)

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`. The first pulse begins at a random time."""
        self._sound.reset(rng)
        self._level.reset(rng)

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        return self._sound.emit(n_samples) * self._level.emit(n_samples)


class Voice:
    """A queue of utterances that are played one after the other, silence while it is empty.

    The high-pass runs over all that is emitted, silence included: a waveform that is passed to
    `say` in parts is emitted like the whole waveform, as long as the queue does not run empty.
    """

    def __init__(self, sample_rate_hz: float = SAMPLE_RATE_HZ) -> None:
        self._high_pass = _HighPass(sample_rate_hz)
        self._queue: deque[Floats] = deque()

    def say(self, waveform: ArrayLike) -> None:
        """Append a waveform ``(n,)`` in rms pressure at 1 m, at the sound field's rate.

        Raises:
            ValueError: If it is not one-dimensional or not finite.
        """
        samples = check_waveform(waveform)
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
        self._high_pass.state[:] = 0.0

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        state = self._high_pass.state
        if not self._queue and not state.any():
            return np.zeros(n_samples, np.float32)
        emitted = self._high_pass(self._take(n_samples))
        if np.abs(state).max() < _NEGLIGIBLE:
            # exact silence: sources that emit zeros cost nothing
            state[:] = 0.0
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


def check_pulses(pulse_s: float, pause_s: float) -> None:
    """Raise `ValueError` if pulses of these durations cannot be made, see `Pulses`."""
    least_s = 2.0 * _RAMP_S
    if not (least_s <= pulse_s <= _LONGEST_S and 0.0 < pause_s <= _LONGEST_S):
        raise ValueError(
            f"pulse_s={pulse_s} must be at least {least_s}, the duration of its ramps, "
            f"and pause_s={pause_s} positive, both at most {_LONGEST_S:g} s"
        )


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
        level: Rms pressure at 1 m, of a pulse without its ramps; full scale of a WAV file is 1.
            Not used by a voice.
        path: WAV file of a clip.
        loop: Whether a clip repeats without end.
        pulse_s: Duration of a pulse, at least 0.01, if there are pauses; see `Pulses`.
        pause_s: Silence between pulses; 0 is a continuous sound.
    """

    kind: SoundKind = SoundKind.buzz
    frequency_hz: float = 150.0
    level: float = 0.1
    path: str | None = None
    loop: bool = True
    pulse_s: float = 0.2
    pause_s: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers, and that a clip and nothing else has a path."""
        check_pitch(self.frequency_hz, SAMPLE_RATE_HZ)
        check_level(self.level)
        if (self.path is None) == (self.kind is SoundKind.clip):
            raise ValueError(
                f"sound of kind {self.kind.value} with path={self.path!r}: a clip needs a path, "
                "other kinds must not have one"
            )
        if math.isnan(self.pulse_s):
            raise ValueError(f"pulse_s={self.pulse_s} must be a duration")
        if self.pause_s != 0.0:
            check_pulses(self.pulse_s, self.pause_s)
            if self.kind in (SoundKind.voice, SoundKind.silence):
                raise ValueError(
                    f"sound of kind {self.kind.value} with pause_s={self.pause_s}: buzz, tone, "
                    "noise and clip can have pauses"
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
    sound = makers[cfg.kind]()
    if cfg.pause_s == 0.0:
        return sound
    return Pulses(sound, cfg.pulse_s, cfg.pause_s, sample_rate_hz)


class Source:
    """One source of a sound field. Made by `SoundField.add_source`.

    Attributes:
        name: Unique in its field.
        sound: What it emits; may be exchanged at any time.
        muted: Whether it emits silence in place of its sound, which continues meanwhile.
        teleports: How often it was teleported.
        memory: The samples that it emitted last.
        silent_samples: How many samples before the present are exactly zero.
    """

    def __init__(self, name: str, sound: Sound, memory_samples: int) -> None:
        self.name = name
        self.sound = sound
        self.muted = False
        self.teleports = 0
        self.memory = SignalMemory(memory_samples)
        self.silent_samples = memory_samples
        self._position: Floats = np.zeros(3)

    @property
    def position(self) -> Floats:
        """``(3,)`` metres in playground coordinates, at the end of the step.

        Setting it moves the source, with Doppler shift; see `teleport`.
        """
        return self._position

    @position.setter
    def position(self, value: ArrayLike) -> None:
        position = np.array(value, dtype=np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise ValueError(f"source {self.name!r}: position must be (3,) finite, got {value!r}")
        self._position = position

    def teleport(self, position: ArrayLike) -> None:
        """Set the position without motion: the sound is cross-faded, without a Doppler sweep."""
        self.position = position
        self.teleports += 1

    def keep(self, memory_samples: int) -> None:
        """Store at least so many samples from now on; earlier ones count as silence."""
        if self.silent_samples >= self.memory.n_samples:
            self.silent_samples = max(self.silent_samples, memory_samples)
        self.memory.extend(memory_samples)

    def reset(self, rng: np.random.Generator) -> None:
        """Clear the stored samples and restart the sound."""
        if self.silent_samples < self.memory.n_samples:
            self.memory.clear()
        self.silent_samples = self.memory.n_samples
        self.sound.reset(rng)

    def advance(self, n_samples: int) -> None:
        """Emit the samples of one control step."""
        emitted = self.sound.emit(n_samples)
        if emitted.shape != (n_samples,):
            raise ValueError(
                f"source {self.name!r}: the sound emitted {emitted.shape}, not ({n_samples},)"
            )
        if not self.muted and emitted.any():
            self.silent_samples = 0
        elif self.silent_samples >= self.memory.n_samples:
            return  # nothing is stored but silence
        else:
            emitted = np.zeros(n_samples, np.float32)
            self.silent_samples += n_samples
        self.memory.append(emitted)
