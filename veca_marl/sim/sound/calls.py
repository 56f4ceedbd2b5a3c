"""A small vocabulary of calls with which agents can signal to each other.

A call is a glide of a harmonic voice from one pitch to another. The calls differ in pitch and in
the direction of the glide. Their meaning is not given: it has to be learnt.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache

import numpy as np

from veca_marl.sim.sound.waveforms import SAMPLE_RATE_HZ, Samples, check_level, check_pitch

_HARMONICS = 8
_TILT = -1.0  # amplitude falls by 6 dB per octave, as a voice at the lips does (Fant 1960)
_FADE_S = 0.01


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
