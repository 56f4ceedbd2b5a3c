"""Thresholds of hearing by age: how loud a tone must be for a child to respond to it.

Sources, all in quiet and by responses of the child, in dB above adults unless stated otherwise; no
table of all ages by one method is known to us:

- adults in the procedure of infants: 7 to 14 dB SPL from 0.5 to 8 kHz (Sinnott, Pisoni & Aslin,
  Infant Behavior and Development 6 (1983) 3-17); 10 here;
- 2 to 4 weeks: 56 dB SPL at 500 Hz, 41 at 4 kHz (Olsho & Gillenwater, "Pure-tone sensitivity of 2-
  to 4-week-old infants", Society for Research in Child Development 1989, ERIC ED307986);
- 3 months: 15 to 30 dB (Olsho, Koch, Carter, Halpin & Spetner, J. Acoust. Soc. Am. 84 (1988) 1316);
  the middle of the range here;
- 6 and 12 months: 14 and 12 dB at 1 kHz, 7 and 5 dB at 4 kHz (Nozza & Wilson, J. Speech and Hearing
  Research 27 (1984) 613-622);
- that they go on falling to those of adults at five years is **our assumption**.

Between two ages and between the two frequencies they are interpolated linearly over the logarithm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats

ADULT_DB_SPL = 10.0
FULL_SCALE_DB_SPL = 94.0
"""Level of an rms pressure of 1, read as pascals."""

_AGES_MONTHS = (0.75, 3.0, 6.0, 12.0, 60.0)
_LOW_HZ, _HIGH_HZ = 1000.0, 4000.0  # the thresholds at 500 Hz count up to the first
_LOW_DB = (46.0, 22.0, 14.0, 12.0, 0.0)
_HIGH_DB = (31.0, 22.0, 7.0, 5.0, 0.0)


def threshold_db_spl(age_months: float, hertz: Floats) -> Floats:
    """Return the least level of a tone that a child hears, in dB SPL.

    Args:
        age_months: Age since birth, greater than 0; the youngest of the sources counts below it,
            and adults beyond five years.
        hertz: ``(n,)`` frequencies.
    """
    age = np.log(age_months)
    low, high = (np.interp(age, np.log(_AGES_MONTHS), rises) for rises in (_LOW_DB, _HIGH_DB))
    octaves = np.log2(np.maximum(hertz, 1.0) / _LOW_HZ) / np.log2(_HIGH_HZ / _LOW_HZ)
    levels: Floats = ADULT_DB_SPL + low + np.clip(octaves, 0.0, 1.0) * (high - low)
    return levels


def threshold_powers(
    age_months: float, weights: NDArray[np.float32], sample_rate_hz: float, bins: int
) -> NDArray[np.float32]:
    """Return the squared magnitude of a tone at the threshold, in each bin of a spectrum.

    Args:
        age_months: See `threshold_db_spl`.
        weights: ``(n,)`` of the window.
        sample_rate_hz: Sampling rate.
        bins: Number of bins of its Fourier transform, from frequency 0 on.

    Returns:
        ``(bins,)``; of a tone in the middle of a bin.
    """
    hertz = np.arange(bins, dtype=np.float64) * (sample_rate_hz / len(weights))
    rms = 10.0 ** ((threshold_db_spl(age_months, hertz) - FULL_SCALE_DB_SPL) / 20.0)
    magnitudes = rms * float(weights.sum()) / np.sqrt(2.0)
    return np.asarray(magnitudes**2, np.float32)
