"""Receivers: a head-related transfer function, two omnidirectional ears, or one.

All implement `veca_marl.sim.sound.Receiver`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.hrtf import HrtfTable
from veca_marl.sim.hearing.receiver_filters import head_related_paths, omnidirectional_paths
from veca_marl.sim.sound import NEAR_FIELD_M, SPEED_OF_SOUND_MPS


class HrtfReceiver:
    """Two ears on a head: each arrival is filtered by the response of its direction.

    The level of each ear is corrected for the distance of the source, see `near_field_gain`.
    """

    n_channels = 2

    def __init__(self, table: HrtfTable) -> None:
        self.table = table
        self.n_taps = table.filters.shape[-1]
        latest_s = float(table.arrival_samples.max()) / table.sample_rate_hz
        self.extent_m = latest_s * SPEED_OF_SOUND_MPS

    def write_paths(
        self,
        arrivals: Floats,
        gains: Floats,
        sample_rate_hz: float,
        delays: Floats,
        filters: NDArray[np.float32],
    ) -> None:
        """See `Receiver`.

        Raises:
            ValueError: If the table was made for another sampling rate.
        """
        if sample_rate_hz != self.table.sample_rate_hz:
            raise ValueError(
                f"the head-related transfer function has {self.table.sample_rate_hz} Hz, the "
                f"sound field {sample_rate_hz} Hz"
            )
        table = self.table
        head_related_paths(
            arrivals,
            gains,
            sample_rate_hz / SPEED_OF_SOUND_MPS,
            table.filters,
            table.arrival_samples,
            table.head_radius_m,
            table.measured_at_m,
            delays,
            filters,
        )


class OmnidirectionalReceivers:
    """Receivers without a head: each has the delay and the 1/d level of its own distance.

    Args:
        ears: ``(n_channels, 3)`` metres in the head frame.
        nearest_m: Distance below which the gain is constant, positive.

    Raises:
        ValueError: If a place is not of three numbers.
    """

    n_taps = 1

    def __init__(self, ears: ArrayLike, nearest_m: float = NEAR_FIELD_M) -> None:
        self.ears: Floats = np.array(ears, np.float64)
        if self.ears.ndim != 2 or self.ears.shape[1] != 3:
            raise ValueError(f"an ear must be three numbers, got {ears!r}")
        self.n_channels = len(self.ears)
        self.extent_m = float(np.linalg.norm(self.ears, axis=1).max())
        self._nearest_m = nearest_m

    def write_paths(
        self,
        arrivals: Floats,
        gains: Floats,
        sample_rate_hz: float,
        delays: Floats,
        filters: NDArray[np.float32],
    ) -> None:
        """See `Receiver`."""
        samples_per_metre = sample_rate_hz / SPEED_OF_SOUND_MPS
        omnidirectional_paths(
            arrivals, gains, samples_per_metre, self.ears, self._nearest_m, delays, filters
        )


class StereoReceiver(OmnidirectionalReceivers):
    """Two receivers at the ears, without a head between them: no head shadow, no pinnae."""

    def __init__(
        self, ear_left: ArrayLike, ear_right: ArrayLike, nearest_m: float = NEAR_FIELD_M
    ) -> None:
        super().__init__(np.stack([ear_left, ear_right]), nearest_m)


class MonoReceiver(OmnidirectionalReceivers):
    """One receiver at the centre of the head: distance but no direction."""

    def __init__(self, nearest_m: float = NEAR_FIELD_M) -> None:
        super().__init__(np.zeros((1, 3)), nearest_m)
