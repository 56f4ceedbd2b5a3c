"""What turns sound that arrives at a head into signals: the interface that listeners use.

A receiver writes the filter from one source to its channels: the sum over the direct sound and its
reflections, each in its direction, relative to the arrival of the direct sound at the head's
centre. The delay of the direct sound itself is a moving read (`fractional_delay.read_delayed`).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.sound.acoustics import SPEED_OF_SOUND_MPS
from veca_marl.sim.sound.fractional_delay import KERNEL_TAPS

_LEAD_S = 0.5e-3
_REACH_S = 1.0e-3


class Receiver(Protocol):
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


def filter_length(spatialisation: Receiver, sample_rate_hz: float, spread_m: float) -> int:
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
