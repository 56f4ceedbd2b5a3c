"""The last samples of a signal, stored for reads at any delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.sound.delay_lines import DEGREE, KERNEL_TAPS, farrow_coefficients, filter_powers

_SHIFT_EVERY = 4096


class SignalMemory:
    """The last samples of a signal. Reads are late by `fractional_delay.HALF_WIDTH` samples.

    Attributes:
        n_samples: How many samples it holds.
        powers: ``(DEGREE + 1, size)`` float32, see `fractional_delay.filter_powers`.
        end: Column of `powers` after the newest sample.
    """

    def __init__(self, n_samples: int) -> None:
        self.n_samples = n_samples
        self.clear()

    def clear(self) -> None:
        """Replace all samples by silence."""
        # columns beyond n_samples are free: samples move to the front when these are used up
        size = self.n_samples + _SHIFT_EVERY
        self.powers: NDArray[np.float32] = np.zeros((DEGREE + 1, size), np.float32)
        self.end = self.n_samples
        self._newest: NDArray[np.float32] = np.zeros(KERNEL_TAPS - 1, np.float32)

    def extend(self, n_samples: int) -> None:
        """Hold at least so many samples from now on; those that are not held count as silence."""
        if n_samples <= self.n_samples:
            return
        stored = self.powers[:, self.end - self.n_samples : self.end]
        self.n_samples, newest = n_samples, self._newest
        self.clear()
        self.powers[:, self.end - stored.shape[1] : self.end] = stored
        self._newest = newest

    def append(self, samples: NDArray[np.float32]) -> None:
        """Store the next samples ``(n,)``; the oldest are dropped."""
        n = samples.size
        if self.end + n > self.powers.shape[1]:
            self._move_to_front(n)
        extended = np.concatenate((self._newest, samples))
        filter_powers(extended, farrow_coefficients(), self.powers, self.end)
        self.end += n
        self._newest = extended[n:]

    def _move_to_front(self, n: int) -> None:
        kept = self.powers[:, self.end - self.n_samples : self.end].copy()
        if self.n_samples + n > self.powers.shape[1]:
            self.powers = np.zeros((DEGREE + 1, self.n_samples + n), np.float32)
        self.powers[:, : self.n_samples] = kept
        self.end = self.n_samples
