"""A sound source: its position and the samples that it emitted last."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.propagation.signal_memory import SignalMemory
from veca_marl.sim.sound.sounds import Sound


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
