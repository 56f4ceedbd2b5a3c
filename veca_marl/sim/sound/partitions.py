"""Transmission through partitions: mass law, plateau, and several of them one behind another."""

from __future__ import annotations

import math

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound.room_acoustics import SPEED_OF_SOUND_MPS

BANDS_HZ: Floats = 125.0 * 2.0 ** np.arange(7, dtype=np.float64)
"""Middles of the octave bands, 125 Hz to 8 kHz (IEC 61260)."""

N_BANDS = len(BANDS_HZ)

REFERENCE_HZ = 500.0
"""The transmission loss of a partition is given at this frequency."""

TRANSMISSION_LOSS_DB = 30.0
"""A limp partition of 15 kg/m2 at 500 Hz by the field-incidence mass law, 20 log10(500 x 15) - 47
= 30.5 dB. Authors differ in its constant (Ebbitt & Hansen 2007, Mass Law - Calculations and
Measurements, SAE 2007-01-2201); 47 is one of those in use, 5 dB below normal incidence, which is
20 log10(pi f m / (rho c)) with rho c = 415 kg/(m2 s)."""

MOST_LOSS_DB = 200.0  # the squares of what passes are numbers of single precision in spectra

_RATIO = BANDS_HZ / REFERENCE_HZ
_RISE: Floats = _RATIO / np.sqrt(0.5 + 0.5 * _RATIO**2)
"""Impedance in each band relative to 500 Hz, in proportion to frequency below, by mass, and nearly
constant above, where coincidence takes up the rise (plateau method; Watters 1959, Transmission
loss of some masonry walls, JASA 31)."""

_WAVE_NUMBERS: Floats = 2.0 * math.pi * BANDS_HZ / SPEED_OF_SOUND_MPS


def surface_ratio(loss_db: float) -> float:
    """Return the impedance of a partition over that of air that gives a loss at `REFERENCE_HZ`."""
    return float(10.0 ** (loss_db / 20.0)) - 1.0


@kernel
def energy_through(n: int, gaps_m: Floats, ratio: float, energy: Floats) -> None:
    """Write the fraction of the energy that passes equal partitions one behind another.

    A limp partition with the impedance z over twice that of air transmits the amplitude
    ``1 / (1 + z)``, two of them with air between them
    ``1 / (1 + 2 z + z^2 (1 - exp(-2 j k d)))`` (London 1950, JASA 22). With magnitudes, and
    ``exp(-2 k d)`` for the coherence, that is the mass law of the sum of both masses where they
    touch, and the sum of both losses where they are far apart.

    Args:
        n: How many partitions.
        gaps_m: ``(n - 1,)`` or more: air between neighbours.
        ratio: See `surface_ratio`.
        energy: ``(N_BANDS,)``, overwritten.
    """
    for band in range(N_BANDS):
        z = ratio * _RISE[band]
        forward, backward = 1.0, 0.0
        for m in range(n):
            if m > 0:
                backward *= math.exp(-2.0 * _WAVE_NUMBERS[band] * gaps_m[m - 1])
            forward, backward = (
                forward * (1.0 + z) - backward * z,
                forward * z + backward * (1.0 - z),
            )
        energy[band] = 1.0 / (forward * forward)
