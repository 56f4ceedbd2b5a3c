"""Receivers: a head-related transfer function, two bare ears, or one microphone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.hearing.ear_filters import bare_ear_filters, head_related_filters
from veca_marl.sim.hearing.hrtf import HeadTable
from veca_marl.sim.sound.acoustics import SPEED_OF_SOUND_MPS
from veca_marl.sim.sound.fractional_delay import kernel_bank
from veca_marl.sim.sound.receiver import lead_samples


class HeadRelated:
    """Two ears on a head: every arrival is filtered by the response of its direction."""

    n_channels = 2

    def __init__(self, table: HeadTable) -> None:
        self.table = table
        self.n_taps = table.filters.shape[-1]

    def write_filters(
        self, arrivals: Floats, gains: Floats, sample_rate_hz: float, out: NDArray[np.float32]
    ) -> None:
        """See `Receiver`."""
        if sample_rate_hz != self.table.sample_rate_hz:
            raise ValueError(
                f"the head was made for {self.table.sample_rate_hz} Hz, the field has "
                f"{sample_rate_hz} Hz"
            )
        table = self.table
        head_related_filters(
            arrivals,
            gains,
            sample_rate_hz / SPEED_OF_SOUND_MPS,
            lead_samples(sample_rate_hz),
            table.filters,
            table.arrival_samples,
            kernel_bank(),
            out,
        )


class TwoEars:
    """Two omnidirectional receivers at the ears, without a head between them.

    Delay and 1/d of each ear's own distance remain; the head's shadow and the pinna do not.
    """

    n_channels = 2
    n_taps = 1

    def __init__(self, ear_left: ArrayLike, ear_right: ArrayLike) -> None:
        """Place the ears: ``(3,)`` metres each, in the head frame."""
        self.ears: Floats = np.stack([ear_left, ear_right]).astype(np.float64)
        if self.ears.shape != (2, 3):
            raise ValueError(f"an ear must be three numbers, got {ear_left!r} and {ear_right!r}")

    def write_filters(
        self, arrivals: Floats, gains: Floats, sample_rate_hz: float, out: NDArray[np.float32]
    ) -> None:
        """See `Receiver`."""
        _write_bare(arrivals, gains, sample_rate_hz, self.ears, out)


class OneEar:
    """One omnidirectional receiver at the head's centre: distance is heard, direction is not."""

    n_channels = 1
    n_taps = 1

    def __init__(self) -> None:
        self.ears: Floats = np.zeros((1, 3))

    def write_filters(
        self, arrivals: Floats, gains: Floats, sample_rate_hz: float, out: NDArray[np.float32]
    ) -> None:
        """See `Receiver`."""
        _write_bare(arrivals, gains, sample_rate_hz, self.ears, out)


def _write_bare(
    arrivals: Floats,
    gains: Floats,
    sample_rate_hz: float,
    ears: Floats,
    out: NDArray[np.float32],
) -> None:
    samples_per_metre = sample_rate_hz / SPEED_OF_SOUND_MPS
    lead = lead_samples(sample_rate_hz)
    bare_ear_filters(arrivals, gains, samples_per_metre, lead, ears, kernel_bank(), out)
