"""A sound as data, and the sound that it describes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from veca_marl.sim.sound.sounds import Clip, Noise, Pulses, Silence, Sound, Voice, check_pulses
from veca_marl.sim.sound.waveforms import (
    SAMPLE_RATE_HZ,
    buzz,
    check_level,
    check_pitch,
    load_wav,
    tone,
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
