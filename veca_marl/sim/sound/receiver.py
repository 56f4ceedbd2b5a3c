"""The interface of receivers, which turn sound that arrives at a head into signals.

A receiver writes the filter from one source to its channels: the sum over the direct sound and its
reflections, each with its direction and with its delay relative to the arrival of the direct sound
at the head's centre. The delay of the direct sound is applied before
(`fractional_delay.read_delayed`).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.sound.acoustics import SPEED_OF_SOUND_MPS
from veca_marl.sim.sound.fractional_delay import KERNEL_TAPS

_LEAD_S = 0.5e-3
_REACH_S = 1.0e-3


class Receiver(Protocol):
    """Filters of one quality of hearing. Stateless: listeners may share one.

    Attributes:
        n_channels: 2, or 1 where both ears have the same signal.
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
            gains: ``(K,)`` pressure gain of each by the walls.
            sample_rate_hz: Sampling rate.
            out: ``(n_channels, n)`` the filters; overwritten.
        """
        ...


def filter_length(receiver: Receiver, sample_rate_hz: float, spread_m: float) -> int:
    """Return the length of the filters of a receiver, samples.

    Args:
        receiver: The receiver.
        sample_rate_hz: Sampling rate.
        spread_m: Additional path length of the last reflection beyond the direct sound.
    """
    # sound arrives later at the far ear than at the head's centre
    longest_s = spread_m / SPEED_OF_SOUND_MPS + _REACH_S
    longest = lead_samples(sample_rate_hz) + int(np.ceil(longest_s * sample_rate_hz))
    return longest + receiver.n_taps + KERNEL_TAPS


def lead_samples(sample_rate_hz: float) -> int:
    """Return the delay of all filters, samples: sound arrives earlier at the near ear."""
    return int(np.ceil(_LEAD_S * sample_rate_hz))
