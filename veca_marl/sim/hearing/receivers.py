"""Receivers: a head-related transfer function, two omnidirectional ears, or one.

All implement `veca_marl.sim.sound.Receiver`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.hrtf import HrtfTable
from veca_marl.sim.kernels import kernel
from veca_marl.sim.sound import NEAR_FIELD_M, SPEED_OF_SOUND_MPS

NEAREST_RADII = 1.25
"""Distance of a source from the centre of the head, in radii of the head, below which its level is
constant; that of the nearest source that Duda & Martens (1998) consider."""

_CENTRE_RADII = 0.1
"""Distance from the centre of the head, in its radii, below which its direction fades out, as there
is none at the centre, and no real source is there."""


@kernel
def sphere_gain(radius_over_distance: float, cosine: float) -> float:
    """Return the pressure at low frequency on a rigid sphere, relative to the free field's.

    The limit of Duda & Martens (1998), eq. 3, at 0 Hz is the series over m of
    ``(2 m + 1) / (m + 1) x^m P_m(cosine)`` with x the radius over the distance; this is its sum.

    Args:
        radius_over_distance: Radius of the sphere over the distance of the point source from its
            centre, in (0, 1).
        cosine: Of the angle between the ear and the source, seen from the centre, in [-1, 1].

    Returns:
        Pressure at the ear over that at the centre of the absent sphere; 1 for a distant source.
    """
    x = radius_over_distance
    root = math.sqrt(1.0 - 2.0 * x * cosine + x * x)
    # equal expressions; each is exact where the other divides by zero
    if cosine > 0.0:
        ratio = (1.0 + cosine) / (root - x + cosine)
    else:
        ratio = (x - cosine + root) / (1.0 - cosine)
    return 2.0 / root - math.log(ratio) / x


@kernel
def near_field_gain(radius_m: float, distance_m: float, reference_m: float, cosine: float) -> float:
    """Return the factor of the level at an ear for a source that is not as far as the measured one.

    It multiplies the response that was measured at `reference_m` and 1/d. The distance variation
    function of a sphere (Kan, Jin & van Schaik 2009) is nearly independent of frequency on the side
    of the source and stronger at high frequency on the other side; its value at low frequency is
    used for all.

    Args:
        radius_m: Radius of the head.
        distance_m: Distance of the source from the centre of the head, at least `NEAREST_RADII`
            times the radius.
        reference_m: Distance of the loudspeaker of the measurement, likewise.
        cosine: Of the angle between the ear and the source, in [-1, 1].
    """
    near = sphere_gain(radius_m / distance_m, cosine)
    return near / sphere_gain(radius_m / reference_m, cosine)


@kernel
def _length(vector: Floats) -> float:
    return float(np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2))


@kernel
def _distance(one: Floats, other: Floats) -> float:
    x, y, z = one[0] - other[0], one[1] - other[1], one[2] - other[2]
    return float(np.sqrt(x**2 + y**2 + z**2))


@kernel
def omnidirectional_paths(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    ears: Floats,
    nearest_m: float,
    delays: Floats,
    filters: NDArray[np.float32],
) -> None:
    """Write the paths to omnidirectional receivers.

    Args:
        arrivals: ``(K, 3)`` metres in the head frame.
        gains: ``(K,)`` product of the walls' reflection and transmission coefficients of each.
        samples_per_metre: Sampling rate divided by the speed of sound.
        ears: ``(E, 3)`` metres in the head frame.
        nearest_m: Distance below which the gain is constant.
        delays: ``(K, E)`` samples, overwritten.
        filters: ``(K, E, 1)``, overwritten.
    """
    for k in range(arrivals.shape[0]):
        for ear in range(ears.shape[0]):
            distance = _distance(arrivals[k], ears[ear])
            delays[k, ear] = distance * samples_per_metre
            filters[k, ear, 0] = np.float32(gains[k] / max(distance, nearest_m))


@kernel
def _grid_cell(
    arrival: Floats, distance: float, n_azimuths: int, n_elevations: int
) -> tuple[int, int, int, float, float]:
    """Return azimuth indices around a direction, the elevation index below, and both fractions."""
    azimuth = np.arctan2(arrival[1], arrival[0]) * (n_azimuths / (2.0 * np.pi))
    sine = min(max(arrival[2] / max(distance, 1e-9), -1.0), 1.0)
    elevation = (np.arcsin(sine) / np.pi + 0.5) * (n_elevations - 1)
    below = int(np.floor(azimuth))
    low = min(int(elevation), n_elevations - 2)
    near, far = below % n_azimuths, (below + 1) % n_azimuths
    return near, far, low, azimuth - below, elevation - low


@kernel
def head_related_paths(
    arrivals: Floats,
    gains: Floats,
    samples_per_metre: float,
    table: NDArray[np.float32],
    arrival_samples: Floats,
    radius_m: float,
    measured_at_m: float,
    delays: Floats,
    filters: NDArray[np.float32],
) -> None:
    """Write the paths to two ears on a head, each with the response of its direction.

    Args:
        arrivals: ``(K, 3)`` metres in the head frame.
        gains: ``(K,)`` product of the walls' reflection and transmission coefficients of each.
        samples_per_metre: Sampling rate divided by the speed of sound.
        table: ``(A, E, 2, T)``, see `HrtfTable.filters`; interpolated bilinearly.
        arrival_samples: ``(A, E, 2)``, see `HrtfTable`.
        radius_m: Radius of the head.
        measured_at_m: Distance at which the responses were measured.
        delays: ``(K, 2)`` samples, overwritten.
        filters: ``(K, 2, T)``, overwritten.
    """
    n_azimuths, n_elevations, n_ears, n_taps = table.shape
    for k in range(arrivals.shape[0]):
        distance = _length(arrivals[k])
        a0, a1, e0, along, up = _grid_cell(arrivals[k], distance, n_azimuths, n_elevations)
        w00, w10 = (1.0 - along) * (1.0 - up), along * (1.0 - up)
        w01, w11 = (1.0 - along) * up, along * up
        limited = max(distance, NEAREST_RADII * radius_m)
        # the true distance: the angle does not depend on what is held constant
        to_left = arrivals[k, 1] / max(distance, _CENTRE_RADII * radius_m)
        for ear in range(n_ears):
            cosine = to_left if ear == 0 else -to_left
            near = near_field_gain(radius_m, limited, measured_at_m, cosine)
            amplitude = gains[k] / limited * near
            c00, c10 = np.float32(amplitude * w00), np.float32(amplitude * w10)
            c01, c11 = np.float32(amplitude * w01), np.float32(amplitude * w11)
            interaural = (
                w00 * arrival_samples[a0, e0, ear]
                + w10 * arrival_samples[a1, e0, ear]
                + w01 * arrival_samples[a0, e0 + 1, ear]
                + w11 * arrival_samples[a1, e0 + 1, ear]
            )
            # negative only inside the head
            delays[k, ear] = max(distance * samples_per_metre + interaural, 0.0)
            for tap in range(n_taps):
                filters[k, ear, tap] = (
                    c00 * table[a0, e0, ear, tap]
                    + c10 * table[a1, e0, ear, tap]
                    + c01 * table[a0, e0 + 1, ear, tap]
                    + c11 * table[a1, e0 + 1, ear, tap]
                )


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
            raise ValueError(f"an ear must be three numbers, got {self.ears.tolist()}")
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
