"""Arrival times of measured head-related impulse responses, and the head radius they imply."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.minimum_phase import minimum_phase
from veca_marl.sim.hearing.sofa import MeasuredHead, SofaError
from veca_marl.sim.hearing.spherical_head import woodworth_arrival_s
from veca_marl.sim.sound import SPEED_OF_SOUND_MPS

USUAL_RADIUS_M = (0.06, 0.11)
"""A fitted radius outside of this range causes a warning."""

POSSIBLE_RADIUS_M = (0.04, 0.16)
"""A fitted radius outside of this range is an error."""

# band of the correlation; the lower end avoids the loudspeaker's roll-off, the upper the pinna
_BAND_HZ = (300.0, 3000.0)
_UPSAMPLING = 16
# greatest deviation from the fitted sphere
_OUTLIER_S = 0.25e-3
# directions with a smaller y component count as median plane
_MEDIAN_PLANE = 0.15
# the radius is fitted to directions with a path difference above 0.4 of the radius
_LATERAL_M = 0.4


def arrival_times(
    measured: MeasuredHead,
    responses: Floats,
    magnitude: Floats,
    incidence: Floats,
    sample_rate_hz: int,
) -> tuple[Floats, float]:
    """Estimate when the sound of each direction arrives at each ear.

    Each response is correlated with its own minimum-phase form; the lag of the peak is its pure
    delay. Peaks farther than 0.25 ms from the time of the fitted sphere
    are replaced by the best peak within that distance.

    Args:
        measured: Directions and stated delays of the measurement.
        responses: ``(M, 2, N)`` windowed impulse responses at `sample_rate_hz`.
        magnitude: ``(M, 2, F)`` their magnitude responses.
        incidence: ``(M, 2)`` rad, see `ear_incidence`.
        sample_rate_hz: Sampling rate.

    Returns:
        Times ``(M, 2)`` in seconds relative to the mean of the median plane, and the radius in
        metres of the sphere, the arrival times of which (Woodworth) fit best.

    Raises:
        SofaError: If there are no directions near the median plane, or the radius is not that of
            a head.
    """
    correlation = _correlate_with_minimum_phase(responses, magnitude, sample_rate_hz)
    lag_s = np.arange(correlation.shape[-1]) / (_UPSAMPLING * sample_rate_hz)
    arrival_s = lag_s[correlation.argmax(axis=-1)] + measured.delays_s
    median_plane = np.abs(measured.directions[:, 1]) < _MEDIAN_PLANE
    if not median_plane.any():
        raise SofaError(f"{measured.source}: has no directions near the median plane")
    centre_s = float(np.median(arrival_s[median_plane]))
    radius_m = _fit_radius(arrival_s - centre_s, incidence)
    check_radius(radius_m, measured.source)
    expected_s = centre_s + radius_m * woodworth_arrival_s(incidence, 1.0)
    _replace_outliers(arrival_s, expected_s, measured.delays_s, lag_s, correlation)
    return arrival_s - arrival_s[median_plane].mean(), radius_m


def _fit_radius(arrival_s: Floats, incidence: Floats) -> float:
    """Return the median, over lateral directions, of time over Woodworth's time per metre."""
    per_metre = woodworth_arrival_s(incidence, 1.0)
    lateral = np.abs(per_metre) > _LATERAL_M / SPEED_OF_SOUND_MPS
    return float(np.median(arrival_s[lateral] / per_metre[lateral]))


def _replace_outliers(
    arrival_s: Floats, expected_s: Floats, delays_s: Floats, lag_s: Floats, correlation: Floats
) -> None:
    """Search again near the expected time where the strongest peak is elsewhere, in place."""
    for m, ear in zip(*np.nonzero(np.abs(arrival_s - expected_s) > _OUTLIER_S), strict=True):
        expected_lag = expected_s[m, ear] - delays_s[m, ear]
        near = np.abs(lag_s - expected_lag) < _OUTLIER_S
        best = lag_s[near][correlation[m, ear, near].argmax()] if near.any() else expected_lag
        arrival_s[m, ear] = best + delays_s[m, ear]


def _correlate_with_minimum_phase(
    responses: Floats, magnitude: Floats, sample_rate_hz: int
) -> NDArray[np.float64]:
    """Return ``(M, 2, 16 N)`` cross-correlations, upsampled, weighted to 0.3 to 3 kHz.

    A measurement of inverted polarity has negative peaks: the common sign of all is divided out.
    """
    n = responses.shape[-1]
    frequency = np.fft.rfftfreq(2 * n, 1.0 / sample_rate_hz)
    reference = np.fft.rfft(minimum_phase(magnitude, n), 2 * n)
    low_hz, high_hz = _BAND_HZ
    weight = (frequency < high_hz) * np.minimum(1.0, frequency / low_hz)
    spectrum = np.fft.rfft(responses, 2 * n) * np.conj(reference) * weight
    n_fine = n * _UPSAMPLING
    correlation = np.fft.irfft(spectrum, 2 * n_fine)[..., :n_fine]
    peaks = np.take_along_axis(correlation, np.abs(correlation).argmax(-1)[..., None], axis=-1)
    signed: NDArray[np.float64] = correlation * np.sign(peaks.sum())
    return signed


def check_radius(radius_m: float, source: str) -> None:
    """Warn if a fitted head radius is unusual.

    Raises:
        SofaError: If it is not that of a head.
    """
    if not POSSIBLE_RADIUS_M[0] <= radius_m <= POSSIBLE_RADIUS_M[1]:
        raise SofaError(
            f"{source}: the arrival times fit a head of radius {radius_m * 100:.1f} cm, which is "
            "not that of a head (wrong sampling rate, swapped axes, or not an HRTF)"
        )
    if not USUAL_RADIUS_M[0] <= radius_m <= USUAL_RADIUS_M[1]:
        warnings.warn(
            f"{source}: the arrival times fit a head of radius {radius_m * 100:.1f} cm, usual are "
            "6 to 11 cm; is the sampling rate right?",
            stacklevel=4,
        )
