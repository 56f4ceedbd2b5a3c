"""The sound of a body that is struck: a sum of decaying oscillations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.sound.modal_synthesis import Modes
from veca_marl.sim.sound.waveforms import Samples

_INAUDIBLE = 1e-6  # pressure, -120 dB: the decay ends here
_TOP_OF_BAND = 0.9


class StruckBody:
    """A `Sound` that is silent until `strike` excites the modes of a body.

    The pressure at 1 m after an impulse J is ``gain J sum_m a_m exp(-d_m t) sin(2 pi f_m t)``
    (van den Doel & Pai 1998, eq. 8): its energy grows with the square of the impulse.
    """

    def __init__(self, modes: Modes, gain_per_ns: float, sample_rate_hz: float) -> None:
        """Prepare the oscillations.

        Args:
            modes: Modes of the body; those above 0.9 of the Nyquist frequency are left out.
            gain_per_ns: Pressure at 1 m per newton second, for a mode of amplitude 1.
            sample_rate_hz: Sampling rate of the sound field.
        """
        audible = modes.below(_TOP_OF_BAND * sample_rate_hz / 2.0)
        rates = -audible.decay_per_s + 2j * np.pi * audible.frequencies_hz
        self._step_per_sample = rates / sample_rate_hz
        amplitudes = gain_per_ns * audible.amplitudes
        self._amplitudes: NDArray[np.complex128] = amplitudes.astype(np.complex128)
        self._state: NDArray[np.complex128] = np.zeros(rates.size, np.complex128)
        self._strikes: list[tuple[int, float]] = []
        self._n_samples = 0
        self._oscillation: NDArray[np.complex128] = np.zeros((rates.size, 0), np.complex128)

    def strike(self, impulse_ns: float, delay_samples: int) -> None:
        """Strike the body within the samples that `emit` returns next.

        Args:
            impulse_ns: Impulse in newton seconds.
            delay_samples: Samples from the beginning of the next call of `emit`.
        """
        self._strikes.append((delay_samples, impulse_ns))

    def reset(self, rng: np.random.Generator) -> None:
        """See `Sound`."""
        self._state[:] = 0.0
        self._strikes.clear()

    def emit(self, n_samples: int) -> Samples:
        """See `Sound`."""
        pressure = np.zeros(n_samples)
        if not self._strikes and not self._state.any():
            return pressure.astype(np.float32)
        self._prepare(n_samples)
        excited = [(0, self._state)]
        for delay, impulse in self._strikes:
            excited.append((min(delay, n_samples - 1), impulse * self._amplitudes))
        after = np.zeros_like(self._state)
        for delay, state in excited:
            rest = n_samples - delay
            pressure[delay:] += (state @ self._oscillation[:, :rest]).imag
            after += state * self._oscillation[:, rest]
        after[np.abs(after) < _INAUDIBLE] = 0.0
        self._state = after
        self._strikes.clear()
        return pressure.astype(np.float32)

    def _prepare(self, n_samples: int) -> None:
        if n_samples != self._n_samples:
            self._n_samples = n_samples
            time = np.arange(n_samples + 1)
            self._oscillation = np.exp(np.outer(self._step_per_sample, time))
