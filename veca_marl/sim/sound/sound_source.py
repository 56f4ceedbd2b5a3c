"""A place that emits sound, and the recent past of what it emitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.sounds import Sound


class Source:
    """One source of a sound field. Made by `SoundField.add_source`.

    Attributes:
        name: Unique in its field.
        sound: What it emits; may be exchanged at any time.
        muted: Whether its sound passes unheard. The sound goes on meanwhile.
        history: ``(H,)`` float32, what it emitted lately, newest sample last.
        jumps: How often it was teleported.
    """

    def __init__(self, name: str, sound: Sound, history_samples: int) -> None:
        self.name = name
        self.sound = sound
        self.muted = False
        self.history: NDArray[np.float32] = np.zeros(history_samples, np.float32)
        self.jumps = 0
        self._position: Floats = np.zeros(3)
        self._silent_samples = history_samples

    @property
    def position(self) -> Floats:
        """``(3,)`` metres in playground coordinates, at the end of the step.

        Setting it is moving it, with Doppler; see `teleport`.
        """
        return self._position

    @position.setter
    def position(self, value: ArrayLike) -> None:
        position = np.array(value, dtype=np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise ValueError(f"source {self.name!r}: position must be (3,) finite, got {value!r}")
        self._position = position

    def teleport(self, position: ArrayLike) -> None:
        """Put it elsewhere: it did not fly there, so there is no Doppler sweep, only a fade."""
        self.position = position
        self.jumps += 1

    @property
    def audible(self) -> bool:
        """Whether any of its history is other than exactly zero."""
        return self._silent_samples < self.history.size

    def reset(self, rng: np.random.Generator) -> None:
        """Forget what was emitted and begin the sound anew."""
        if self.audible:
            self.history[:] = 0.0
        self._silent_samples = self.history.size
        self.sound.reset(rng)

    def advance(self, n_samples: int) -> None:
        """Emit the samples of one control step."""
        emitted = self.sound.emit(n_samples)
        if emitted.shape != (n_samples,):
            raise ValueError(
                f"source {self.name!r}: the sound emitted {emitted.shape}, not ({n_samples},)"
            )
        if self.muted or not emitted.any():
            if not self.audible:
                return
            emitted = np.zeros(n_samples, np.float32)
            self._silent_samples += n_samples
        else:
            self._silent_samples = 0
        self.history[:-n_samples] = self.history[n_samples:]
        self.history[-n_samples:] = emitted
