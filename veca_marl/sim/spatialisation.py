"""How a head turns arriving sound into two ear signals: through an HRTF, two bare ears, or one.

Each object writes the filter from one source to the ears: the sum over the direct sound and its
reflections, each in its direction, *relative to the arrival of the direct sound at the head's
centre*. That way itself is travelled by a moving delay (`fractional_delay.read_delayed`).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.acoustics import NEAR_FIELD_M, SPEED_OF_SOUND_MPS
from veca_marl.sim.fractional_delay import KERNEL_TAPS, fractional_kernel, kernel_bank
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
        _head_related_filters(
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
    _bare_filters(arrivals, gains, samples_per_metre, lead, ears, kernel_bank(), out)


@njit(cache=True)
def _length(vector: Floats) -> float:
    return float(np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2))


@njit(cache=True)
def _split(position: float, last: int) -> tuple[int, float]:
    """Split a position in samples into whole and fraction, held within the filter."""
    held = min(max(position, 0.0), float(last))
    whole = min(int(held), last - 1)
    return whole, held - whole


@njit(cache=True)
def _bare_filters(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    lead: int,
    ears: Floats,
    bank: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    kernel = np.empty(KERNEL_TAPS, np.float32)
    direct = _length(arrivals[0])
    out[:] = 0.0
    last = out.shape[1] - KERNEL_TAPS
    for k in range(arrivals.shape[0]):
        for ear in range(ears.shape[0]):
            distance = _length(arrivals[k] - ears[ear])
            position = lead + (distance - direct) * samples_per_metre
            whole, fraction = _split(position, last)
            fractional_kernel(bank, fraction, kernel)
            amplitude = np.float32(gains[k] / max(distance, NEAR_FIELD_M))
            for tap in range(KERNEL_TAPS):
                out[ear, whole + tap] += amplitude * kernel[tap]


@njit(cache=True)
def _grid_cell(
    arrival: Floats, distance: float, n_azimuths: int, n_elevations: int
) -> tuple[int, int, int, float, float]:
    """Return azimuths left and right of a direction, elevation below it, and both fractions."""
    azimuth = np.arctan2(arrival[1], arrival[0]) * (n_azimuths / (2.0 * np.pi))
    sine = min(max(arrival[2] / max(distance, 1e-9), -1.0), 1.0)
    elevation = (np.arcsin(sine) / np.pi + 0.5) * (n_elevations - 1)
    below = int(np.floor(azimuth))
    low = min(int(elevation), n_elevations - 2)
    near, far = below % n_azimuths, (below + 1) % n_azimuths
    return near, far, low, azimuth - below, elevation - low


@njit(cache=True, fastmath={"contract"})
def _head_related_filters(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    lead: int,
    filters: NDArray[np.float32],
    arrival_samples: Floats,
    bank: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    n_azimuths, n_elevations, n_ears, n_taps = filters.shape
    kernel = np.empty(KERNEL_TAPS, np.float32)
    blended = np.empty(n_taps, np.float32)
    direct = _length(arrivals[0])
    out[:] = 0.0
    last = out.shape[1] - n_taps - KERNEL_TAPS
    for k in range(arrivals.shape[0]):
        distance = _length(arrivals[k])
        a0, a1, e0, along, up = _grid_cell(arrivals[k], distance, n_azimuths, n_elevations)
        w00, w10 = (1.0 - along) * (1.0 - up), along * (1.0 - up)
        w01, w11 = (1.0 - along) * up, along * up
        amplitude = gains[k] / max(distance, NEAR_FIELD_M)
        for ear in range(n_ears):
            interaural = (
                w00 * arrival_samples[a0, e0, ear]
                + w10 * arrival_samples[a1, e0, ear]
                + w01 * arrival_samples[a0, e0 + 1, ear]
                + w11 * arrival_samples[a1, e0 + 1, ear]
            )
            position = lead + (distance - direct) * samples_per_metre
            whole, fraction = _split(position + interaural, last)
            fractional_kernel(bank, fraction, kernel)
            c00, c10 = np.float32(amplitude * w00), np.float32(amplitude * w10)
            c01, c11 = np.float32(amplitude * w01), np.float32(amplitude * w11)
            for tap in range(n_taps):
                blended[tap] = (
                    c00 * filters[a0, e0, ear, tap]
                    + c10 * filters[a1, e0, ear, tap]
                    + c01 * filters[a0, e0 + 1, ear, tap]
                    + c11 * filters[a1, e0 + 1, ear, tap]
                )
            for lag in range(KERNEL_TAPS):
                coefficient = kernel[lag]
                row = out[ear, whole + lag : whole + lag + n_taps]
                for tap in range(n_taps):
                    row[tap] += coefficient * blended[tap]
