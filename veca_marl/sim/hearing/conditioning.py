"""Conditioning of measured impulse responses: window, resample, equalise, separate the delay."""

from __future__ import annotations

import math
import warnings

import numpy as np
import scipy.signal
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.head_response import HeadResponse, minimum_phase
from veca_marl.sim.hearing.sofa import MeasuredHead
from veca_marl.sim.hearing.sofa_file import SofaError
from veca_marl.sim.hearing.spherical_head import ear_incidence, sphere_response, woodworth_arrival_s
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

# window around the peak: seconds before it, seconds after it, and length of the fade-out
_BEFORE_PEAK_S, _AFTER_PEAK_S, _FADE_OUT_S = 1.5e-3, 4.0e-3, 2.0e-3
_SHORT_S = 0.02
_FILTER_S = 128 / 22_050
# below the first frequency the response is that of the sphere, above the second the measured one
_BLEND_HZ = (150.0, 350.0)
# fraction of the sampling rate above which the anti-aliasing filter would be equalised
_TOP_OF_BAND = 0.47


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


def condition(
    measured: MeasuredHead, sample_rate_hz: int, n_taps: int | None = None, licence: str = ""
) -> HeadResponse:
    """Convert measured impulse responses to minimum-phase filters and arrival times.

    Windows the response around its peak, divides by the diffuse field (the mean over all
    directions; Moller 1992), replaces frequencies below the loudspeaker's band (150 Hz) by the
    response of a rigid sphere, and separates the arrival time from the minimum-phase filter.

    Args:
        measured: From `read_sofa`.
        sample_rate_hz: Sampling rate of the result.
        n_taps: Length of the filters; None is 5.8 ms, 128 taps at 22 050 Hz, the rms error of
            which is 0.07 dB below 5.4 kHz.
        licence: Terms and authors of the measurement, stored with the result.

    Raises:
        SofaError: If the arrival times are not those of a head.
    """
    n_taps = round(_FILTER_S * sample_rate_hz) if n_taps is None else n_taps
    responses = _window(_resample(measured, sample_rate_hz), sample_rate_hz)
    n_fft = max(1024, 1 << (responses.shape[-1] - 1).bit_length())
    magnitude = np.abs(np.fft.rfft(responses, n_fft)).astype(np.float64)
    frequency = np.fft.rfftfreq(n_fft, 1.0 / sample_rate_hz).astype(np.float64)
    incidence = ear_incidence(measured.directions)
    arrival_s, radius_m = arrival_times(measured, responses, magnitude, incidence, sample_rate_hz)
    equalised = magnitude / _diffuse_field(magnitude, frequency, measured.directions)
    sphere = (radius_m, measured.distance_m)
    blended = _blend_with_sphere(equalised, frequency, incidence, *sphere)
    top = int(_TOP_OF_BAND * n_fft)
    blended[..., top:] = blended[..., top : top + 1]
    filters = minimum_phase(blended, n_taps) * _fade_out(n_taps)
    return HeadResponse(
        measured.directions,
        filters.astype(np.float32),
        arrival_s,
        sample_rate_hz,
        radius_m,
        measured.distance_m,
        licence,
    )


def _resample(measured: MeasuredHead, sample_rate_hz: int) -> Floats:
    rate = round(measured.sample_rate_hz)
    if rate == sample_rate_hz:
        return measured.impulse_responses
    common = math.gcd(rate, sample_rate_hz)
    resampled: Floats = scipy.signal.resample_poly(
        measured.impulse_responses,
        sample_rate_hz // common,
        rate // common,
        axis=-1,
        window=("kaiser", 8.0),
    )
    # a sampled impulse response scales with its sampling period
    return resampled * (rate / sample_rate_hz)


def _window(responses: Floats, sample_rate_hz: int) -> Floats:
    """Keep -1.5 to +6 ms around each peak; the rest of a measurement is reflections and noise.

    Responses of more than 20 ms are cut where the windows of all of them are over.
    """
    peak = np.abs(responses).argmax(axis=-1)[..., None]
    last = int(peak.max()) + math.ceil((_AFTER_PEAK_S + _FADE_OUT_S) * sample_rate_hz)
    responses = responses[..., : max(last + 1, int(_SHORT_S * sample_rate_hz))]
    since_peak_s = (np.arange(responses.shape[-1]) - peak) / sample_rate_hz
    rise = np.clip((since_peak_s + _BEFORE_PEAK_S) / (0.3 * _BEFORE_PEAK_S), 0.0, 1.0)
    fall = np.clip((since_peak_s - _AFTER_PEAK_S) / _FADE_OUT_S, 0.0, 1.0)
    windowed: Floats = responses * rise * (0.5 + 0.5 * np.cos(np.pi * fall))
    return windowed


def _fade_out(n_taps: int) -> Floats:
    fade = np.ones(n_taps)
    quarter = n_taps // 4
    fade[-quarter:] = 0.5 + 0.5 * np.cos(np.pi * (np.arange(quarter) + 0.5) / quarter)
    return fade


def _diffuse_field(magnitude: Floats, frequency: Floats, directions: Floats) -> Floats:
    """Return the mean magnitude over the sphere and both ears, smoothed to third octaves."""
    weights = _solid_angles(directions)
    log_power = np.log(np.einsum("mef,m->f", magnitude**2, weights) / 2.0 + 1e-12)
    step_hz = frequency[1]
    low = np.searchsorted(frequency, frequency / 2.0 ** (1 / 6) - step_hz, side="left")
    high = np.searchsorted(frequency, frequency * 2.0 ** (1 / 6) + step_hz, side="right")
    total = np.concatenate([[0.0], np.cumsum(log_power)])
    smooth: Floats = (total[high] - total[low]) / (high - low)
    return np.exp(0.5 * smooth)


def _solid_angles(directions: Floats, n_points: int = 40_000) -> Floats:
    """Return the share ``(M,)`` of points on the sphere that are nearest to each direction."""
    index = np.arange(n_points) + 0.5
    height = 1.0 - 2.0 * index / n_points
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - height**2)
    points = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), height], axis=1)
    nearest = cKDTree(directions).query(points)[1]
    return np.bincount(nearest, minlength=len(directions)) / n_points


def _blend_with_sphere(
    magnitude: Floats, frequency: Floats, incidence: Floats, radius_m: float, distance_m: float
) -> Floats:
    """Replace magnitudes below the loudspeaker's band by those of a rigid sphere."""
    low_hz, high_hz = _BLEND_HZ
    octave = np.log(np.maximum(frequency, 1.0) / low_hz) / np.log(high_hz / low_hz)
    measured_share = np.clip(octave, 0.0, 1.0)
    n_low = int(np.searchsorted(frequency, high_hz))
    angles = np.linspace(0.0, np.pi, 37)
    table = np.abs(sphere_response(angles, frequency[:n_low], radius_m, distance_m))
    sphere = np.stack([np.interp(incidence, angles, column) for column in table.T], axis=-1)
    share = measured_share[:n_low]
    blended = magnitude.copy()
    log_measured = np.log(np.maximum(magnitude[..., :n_low], 1e-5))
    blended[..., :n_low] = np.exp(share * log_measured + (1.0 - share) * np.log(sphere))
    return blended
