"""How a head turns arriving sound into two ear signals: through an HRTF, two bare ears, or one.

Each object writes the filter from one source to the ears: the sum over the direct sound and its
reflections, each in its direction, *relative to the arrival of the direct sound at the head's
centre*. That way itself is travelled by a moving delay (`fractional_delay.read_delayed`).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.acoustics import SPEED_OF_SOUND_MPS
from veca_marl.sim.ear_filters import bare_ear_filters, head_related_filters
from veca_marl.sim.fractional_delay import KERNEL_TAPS, kernel_bank
from veca_marl.sim.hrtf import HeadTable
from veca_marl.sim.pose import Floats

_LEAD_S = 0.5e-3
_REACH_S = 1.0e-3


class Spatialisation(Protocol):
    """What exchanges the quality of hearing; stateless, may be shared between listeners.

    Attributes:
        n_channels: 2, or 1 where both ears hear the same.
        n_taps: Length of the response to one arrival.
    """

    n_channels: int
    n_taps: int

    def write_filters(
        self, arrivals: Floats, gains: Floats, sample_rate_hz: float, out: NDArray[np.float32]
    ) -> None:
        """Write the filters of one source.

        Args:
            arrivals: ``(K, 3)`` metres from the head's centre to the source and its images, in
                the head frame, direct sound first.
            gains: ``(K,)`` what the walls left of each.
            sample_rate_hz: Sampling rate.
            out: ``(n_channels, n)`` the filters; overwritten.
        """
        ...


class HeadRelated:
    """Two ears on a head: every arrival is filtered by the response of its direction."""

    n_channels = 2

    def __init__(self, table: HeadTable) -> None:
        self.table = table
        self.n_taps = table.filters.shape[-1]

    def write_filters(
        self, arrivals: Floats, gains: Floats, sample_rate_hz: float, out: NDArray[np.float32]
    ) -> None:
        """See `Spatialisation`."""
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
        """See `Spatialisation`."""
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
        """See `Spatialisation`."""
        _write_bare(arrivals, gains, sample_rate_hz, self.ears, out)


def filter_length(spatialisation: Spatialisation, sample_rate_hz: float, spread_m: float) -> int:
    """Return how many samples a filter needs.

    Args:
        spatialisation: Whose filter.
        sample_rate_hz: Sampling rate.
        spread_m: How much further than the direct sound the last reflection may travel.
    """
    # the far ear hears later than the head's centre would
    longest_s = spread_m / SPEED_OF_SOUND_MPS + _REACH_S
    longest = lead_samples(sample_rate_hz) + int(np.ceil(longest_s * sample_rate_hz))
    return longest + spatialisation.n_taps + KERNEL_TAPS


def lead_samples(sample_rate_hz: float) -> int:
    """Return by how much filters are delayed: the near ear hears before the head's centre would."""
    return int(np.ceil(_LEAD_S * sample_rate_hz))


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
