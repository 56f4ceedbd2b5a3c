"""Head-related transfer functions on a regular grid of directions, for bilinear interpolation."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.conditioning import condition
from veca_marl.sim.hearing.head_response import HeadResponse, minimum_phase
from veca_marl.sim.hearing.sofa import read_sofa
from veca_marl.sim.hearing.spherical_head import ear_incidence, woodworth_arrival_s

GRID_STEP_DEG = 5
# length of transforms in lengths of the filters: a short cepstrum aliases
_OVERSAMPLING = 4
_MIN_MAGNITUDE = 1e-5
_BATCH = 256
# directions of the lowest ring are moved up by this angle into the triangles
_INSIDE_RAD = 1e-6


def stand_ins(directions: Floats, lowest_rad: float) -> tuple[Floats, Floats]:
    """Return two directions of the lowest ring for each direction below it, and their weights.

    Both have the lateral angle of the direction, on which interaural differences depend most
    (the cone of confusion); one lies in front and one behind. The weights change linearly with the
    angle around the ear axis, so that a response is continuous under the head and equals that of
    the ring on the ring.

    Args:
        directions: ``(..., 3)`` unit vectors with an elevation of at most `lowest_rad`.
        lowest_rad: Elevation of the ring, above -pi / 2.

    Returns:
        ``(..., 2, 3)`` unit vectors on the ring, the one in front first, and weights ``(..., 2)``.
    """
    lateral = directions[..., 1]
    down = np.sin(lowest_rad)
    forward = np.sqrt(np.maximum(np.cos(lowest_rad) ** 2 - lateral**2, 0.0))
    front = np.stack([forward, lateral, np.full_like(lateral, down)], axis=-1)
    behind = front * np.array([-1.0, 1.0, 1.0])
    # angles below the horizontal plane around the ear axis, counted from the front
    around = np.arctan2(-directions[..., 2], directions[..., 0])
    first = np.arctan2(-down, forward)
    to_behind = np.clip((around - first) / np.maximum(np.pi - 2.0 * first, 1e-9), 0.0, 1.0)
    return np.stack([front, behind], axis=-2), np.stack([1.0 - to_behind, to_behind], axis=-1)


def arrival_below_s(below: Floats, ring: Floats, ring_arrival_s: Floats, radius_m: float) -> Floats:
    """Return arrival times ``(A, E, 2)`` in s of directions below the lowest measured ring.

    They are Woodworth's plus a correction. On the ring it is the difference between the measured
    times and Woodworth's, so that times are continuous there; at the nadir it is the mean of the
    differences over all azimuths and both ears, so that times do not depend on the azimuth. In
    between it changes in proportion to the horizontal component of the direction.

    Args:
        below: ``(A, E, 3)`` unit vectors.
        ring: ``(A, 1, 3)`` unit vectors on the ring with the same azimuths.
        ring_arrival_s: ``(A, 1, 2)`` measured times of these.
        radius_m: Radius of the sphere that fits the measured times.
    """
    difference_s = ring_arrival_s - woodworth_arrival_s(ear_incidence(ring), radius_m)
    mean_s = difference_s.mean()
    share = _horizontal(below) / _horizontal(ring)
    sphere_s = woodworth_arrival_s(ear_incidence(below), radius_m)
    arrival_s: Floats = sphere_s + mean_s + share * (difference_s - mean_s)
    return arrival_s


def _horizontal(directions: Floats) -> Floats:
    """Return the lengths ``(..., 1)`` of the horizontal components of unit vectors."""
    lengths: Floats = np.linalg.norm(directions[..., :2], axis=-1, keepdims=True)
    return lengths


class HrtfTable:
    """Filters and arrival times of a head on a regular grid of azimuths and elevations.

    Below the lowest measured ring the filters are those of the ring with the same lateral angle,
    see `stand_ins`, and the arrival times those of a sphere that join the ring's, see
    `arrival_below_s`.

    Read-only and shared by all listeners of a process.

    Attributes:
        filters: ``(A, E, 2, T)`` minimum-phase filters; azimuth ``a * step`` counted to the left
            from straight ahead, elevation ``-90 + e * step`` degrees; left ear first.
        arrival_samples: ``(A, E, 2)`` arrival time relative to the head's centre.
        sample_rate_hz: Sampling rate.
        head_radius_m: Radius of the sphere that fits the arrival times.
        measured_at_m: Distance of the loudspeaker from the centre of the head.
        licence: Terms and authors of the measurement.
    """

    def __init__(self, response: HeadResponse, step_deg: int = GRID_STEP_DEG) -> None:
        azimuth = np.deg2rad(np.arange(0, 360, step_deg))
        elevation = np.deg2rad(np.arange(-90, 91, step_deg))
        # measurements end above the nadir
        ring = np.arcsin(np.clip(response.directions[:, 2].min(), -1.0, 1.0))
        inside = ring + _INSIDE_RAD
        below = direction_vectors(azimuth, elevation[elevation < ring - _INSIDE_RAD])
        above = elevation[below.shape[1] :]
        parts = [
            _triangles(response.directions, direction_vectors(azimuth, np.maximum(above, inside)))
        ]
        if below.size:
            parts.insert(0, _ring_corners(response.directions, below, inside))
        self.filters = np.concatenate(
            [_interpolate_filters(response.filters, *part) for part in parts], axis=1
        )
        arrival_s = [_interpolate_times(response.arrival_s, *parts[-1])]
        if below.size:
            lowest = direction_vectors(azimuth, np.array([inside]))
            ring_s = _interpolate_times(
                response.arrival_s, *_triangles(response.directions, lowest)
            )
            arrival_s.insert(0, arrival_below_s(below, lowest, ring_s, response.head_radius_m))
        self.arrival_samples: Floats = np.concatenate(arrival_s, axis=1) * response.sample_rate_hz
        self.filters.setflags(write=False)
        self.arrival_samples.setflags(write=False)
        self.sample_rate_hz = response.sample_rate_hz
        self.head_radius_m = response.head_radius_m
        self.measured_at_m = response.measured_at_m
        self.licence = response.licence


@cache
def kemar_response(sample_rate_hz: int = 22_050) -> HeadResponse:
    """Return the packaged measurement: KEMAR (Gardner & Martin 1994).

    Raises:
        ValueError: If the packaged data have another sampling rate.
    """
    with as_file(files("veca_marl") / "data" / "kemar.npz") as path:
        response = HeadResponse.load(path)
    if response.sample_rate_hz != sample_rate_hz:
        raise ValueError(
            f"KEMAR is shipped at {response.sample_rate_hz} Hz, got {sample_rate_hz}; "
            "another rate needs the SOFA file"
        )
    return response


@cache
def sofa_response(
    path: str, sample_rate_hz: int = 22_050, stated_rate_hz: float | None = None
) -> HeadResponse:
    """Return the response of the head in a SOFA file, conditioned for a sampling rate.

    Args:
        path: The file.
        sample_rate_hz: Sampling rate of the sound field.
        stated_rate_hz: Sampling rate to use instead of the file's own, see `read_sofa`.

    Raises:
        ImportError: If h5py is missing.
        SofaError: If the file cannot be used.
    """
    measured = read_sofa(path, stated_rate_hz)
    return condition(measured, sample_rate_hz, licence=f"see {measured.source}")


def kemar_table(sample_rate_hz: int = 22_050, head_scale: float = 1.0) -> HrtfTable:
    """Return the table of `kemar_response`; the same object for the same numbers.

    Args:
        sample_rate_hz: Sampling rate of the sound field.
        head_scale: See `HeadResponse.scaled`.

    Raises:
        ValueError: If the packaged data have another sampling rate, or the scale is out of range.
    """
    return _kemar_table(sample_rate_hz, head_scale)


@cache
def _kemar_table(sample_rate_hz: int, head_scale: float) -> HrtfTable:
    return HrtfTable(kemar_response(sample_rate_hz).scaled(head_scale))


def sofa_table(
    path: str,
    sample_rate_hz: int = 22_050,
    stated_rate_hz: float | None = None,
    head_scale: float = 1.0,
) -> HrtfTable:
    """Return the table of `sofa_response`; the same object for the same arguments.

    Args:
        path: The file.
        sample_rate_hz: Sampling rate of the sound field.
        stated_rate_hz: Sampling rate to use instead of the file's own, see `read_sofa`.
        head_scale: See `HeadResponse.scaled`.

    Raises:
        ImportError: If h5py is missing.
        SofaError: If the file cannot be used.
        ValueError: If the scale is out of range.
    """
    return _sofa_table(path, sample_rate_hz, stated_rate_hz, head_scale)


@cache
def _sofa_table(
    path: str, sample_rate_hz: int, stated_rate_hz: float | None, head_scale: float
) -> HrtfTable:
    return HrtfTable(sofa_response(path, sample_rate_hz, stated_rate_hz).scaled(head_scale))


def direction_vectors(azimuth_rad: Floats, elevation_rad: Floats) -> Floats:
    """Return unit vectors ``(A, E, 3)`` in the head frame: all azimuths by all elevations."""
    azimuth, elevation = np.meshgrid(azimuth_rad, elevation_rad, indexing="ij")
    horizontal = np.cos(elevation)
    return np.stack(
        [horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), np.sin(elevation)], axis=-1
    )


def _triangles(measured: Floats, requested: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Find the spherical triangle of measured directions around each requested one ``(..., 3)``.

    Returns:
        Indices ``(..., 3)`` into the measured directions, and weights that sum to 1.
    """
    nadir = np.array([[0.0, 0.0, -1.0]])
    closed = np.concatenate([measured, nadir])  # the hull must enclose the origin
    triangles = ConvexHull(closed).simplices
    inverse = np.linalg.inv(closed[triangles].transpose(0, 2, 1))
    flat = requested.reshape(-1, 3)
    corners, weights = [], []
    for batch in np.array_split(flat, 1 + len(flat) // _BATCH):
        coordinates = np.einsum("tij,qj->qti", inverse, batch)
        best = coordinates.min(axis=-1).argmax(axis=1)
        corners.append(triangles[best])
        weights.append(np.maximum(coordinates[np.arange(len(batch)), best], 0.0))
    corner, weight = np.concatenate(corners), np.concatenate(weights)
    added = corner == len(measured)
    corner[added], weight[added] = 0, 0.0
    weight /= weight.sum(axis=1, keepdims=True)
    shape = (*requested.shape[:-1], 3)
    return corner.reshape(shape).astype(np.int64), weight.reshape(shape)


def _ring_corners(
    measured: Floats, below: Floats, ring_rad: float
) -> tuple[NDArray[np.int64], Floats]:
    """Find measured directions on the lowest ring that stand in for directions below it.

    Returns:
        Indices ``(A, E, 6)`` into the measured directions, and weights that sum to 1.
    """
    on_ring, shares = stand_ins(below, ring_rad)
    corners, weights = _triangles(measured, on_ring)
    shape = (*below.shape[:2], 6)
    return corners.reshape(shape), (weights * shares[..., None]).reshape(shape)


def _interpolate_times(arrival_s: Floats, corners: NDArray[np.int64], weights: Floats) -> Floats:
    """Interpolate arrival times ``(M, 2)``; ``(A, E, 2)``."""
    times_s: Floats = np.einsum("aek,aekc->aec", weights, arrival_s[corners])
    return times_s


def _interpolate_filters(
    filters: NDArray[np.float32], corners: NDArray[np.int64], weights: Floats
) -> NDArray[np.float32]:
    """Interpolate log magnitudes, and return the minimum-phase filters of the result."""
    n_fft = 1 << (_OVERSAMPLING * filters.shape[-1] - 1).bit_length()
    magnitude = np.abs(scipy.fft.rfft(filters, n_fft))
    log_magnitude = np.log(np.maximum(magnitude, _MIN_MAGNITUDE))
    table = np.empty((*corners.shape[:2], *filters.shape[1:]), np.float32)
    for a in range(corners.shape[0]):
        blended = np.einsum(
            "ek,ekcf->ecf", weights[a].astype(np.float32), log_magnitude[corners[a]]
        )
        table[a] = minimum_phase(np.exp(blended), filters.shape[-1])
    return table
