"""The sound at the ears of an agent, played while it is simulated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

_PEAK = 0.8  # of full scale
_FULL_SCALE = 32_767
_SHORTEST_S = 0.12  # of a block: below, gaps between blocks are audible
_LONGEST_S = 1.0  # of sound that waits; older sound is dropped


class Loudspeaker:
    """Plays waveforms one after another, as long as they come in real time.

    All samples are scaled by one factor, which falls when a greater amplitude than before occurs.

    Args:
        sample_rate_hz: Samples per second.

    Raises:
        pygame.error: If there is no loudspeaker.
    """

    def __init__(self, sample_rate_hz: int) -> None:
        pygame.mixer.init(sample_rate_hz, -16, 2, 1024, allowedchanges=0)
        self._channel = pygame.mixer.Channel(0)
        self._rate_hz = sample_rate_hz
        self._waiting: NDArray[Any] = np.zeros((2, 0), np.float32)
        self._peak = 1e-3

    def add(self, waveform: NDArray[Any]) -> None:
        """Append the samples ``(2, n)`` of a step."""
        self._peak = max(self._peak, float(np.abs(waveform).max(initial=0.0)))
        waiting = np.concatenate((self._waiting, waveform), axis=1)
        self._waiting = waiting[:, -round(_LONGEST_S * self._rate_hz) :]
        enough = self._waiting.shape[1] >= _SHORTEST_S * self._rate_hz
        if enough and self._channel.get_queue() is None:
            self._channel.queue(pygame.mixer.Sound(buffer=pcm(self._waiting, self._peak)))
            self._waiting = self._waiting[:, :0]


def pcm(waveform: NDArray[Any], peak: float) -> bytes:
    """Return samples ``(2, n)`` as interleaved 16-bit integers, `peak` at 0.8 of full scale."""
    scaled = np.clip(waveform * (_PEAK / peak), -1.0, 1.0)
    return np.round(_FULL_SCALE * scaled.T).astype(np.int16).tobytes()
