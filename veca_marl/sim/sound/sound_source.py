"""A sound source: its position and the samples that it emitted last."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.sounds import Sound


class Source:
    """One source of a sound field. Made by `SoundField.add_source`.

    Attributes:
        name: Unique in its field.
        sound: What it emits; may be exchanged at any time.
        muted: Whether it emits silence in place of its sound, which continues meanwhile.
        teleports: How often it was teleported.
    """

    def __init__(self, name: str, sound: Sound, history_samples: int) -> None:
        self.name = name
        self.sound = sound
        self.muted = False
        self.teleports = 0
        self._position: Floats = np.zeros(3)
        self._history_samples = history_samples
        self._memory: NDArray[np.float32] = np.zeros(history_samples, np.float32)
        self._silent_samples = history_samples

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

    @property
    def history(self) -> NDArray[np.float32]:
        """``(H,)`` the last samples, newest last: all that can arrive within the present step."""
        return self._memory[-self._history_samples :]

    @property
    def audible(self) -> bool:
        """Whether any sample of its history is not exactly zero."""
        return self._silent_samples < self._history_samples

    def keep(self, memory_samples: int) -> None:
        """Store at least so many samples from now on; those emitted before count as silence.

        Only listeners that left out steps need more than `history`, see `past`.
        """
        added = memory_samples - self._memory.size
        if added > 0:
            self._memory = np.concatenate((np.zeros(added, np.float32), self._memory))
            self._silent_samples += added if not self.audible else 0

    def past(self, age_samples: int) -> NDArray[np.float32]:
        """Return a view of all stored samples except the newest.

        Args:
            age_samples: How many of the newest samples to leave out, at least 1.
        """
        return self._memory[:-age_samples]

    def reset(self, rng: np.random.Generator) -> None:
        """Clear the stored samples and restart the sound."""
        if self._silent_samples < self._memory.size:
            self._memory[:] = 0.0
        self._silent_samples = self._memory.size
        self.sound.reset(rng)

    def advance(self, n_samples: int) -> None:
        """Emit the samples of one control step."""
        emitted = self.sound.emit(n_samples)
        if emitted.shape != (n_samples,):
            raise ValueError(
                f"source {self.name!r}: the sound emitted {emitted.shape}, not ({n_samples},)"
            )
        if self.muted or not emitted.any():
            if self._silent_samples >= self._memory.size:
                return
            emitted = np.zeros(n_samples, np.float32)
            self._silent_samples += n_samples
        else:
            self._silent_samples = 0
        self._memory[:-n_samples] = self._memory[n_samples:]
        self._memory[-n_samples:] = emitted
