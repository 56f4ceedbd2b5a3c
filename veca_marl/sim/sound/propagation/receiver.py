"""The interface of receivers, which turn sound that arrives at a head into signals."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats


class Receiver(Protocol):
    """Ears of one quality. Stateless: listeners may share one.

    Attributes:
        n_channels: 2, or 1 where both ears have the same signal.
        n_taps: Length of the filter of one path; 1 for a gain without a filter.
        extent_m: Greatest length by which the path to an ear exceeds the one to the head's centre.
    """

    n_channels: int
    n_taps: int
    extent_m: float

    def write_paths(
        self,
        arrivals: Floats,
        gains: Floats,
        sample_rate_hz: float,
        delays: Floats,
        filters: NDArray[np.float32],
    ) -> None:
        """Write the delay and the filter of each path to each channel.

        Args:
            arrivals: ``(K, 3)`` metres from the head's centre to the source and its images, in
                the head frame.
            gains: ``(K,)`` pressure gain of each by the walls.
            sample_rate_hz: Sampling rate.
            delays: ``(K, n_channels)`` samples from the emission to the arrival at the ear, not
                negative; overwritten.
            filters: ``(K, n_channels, n_taps)`` impulse responses without that delay; gain and
                attenuation by distance are included; overwritten.
        """
        ...
