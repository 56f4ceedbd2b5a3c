"""From a measured head to its compact form: window, resample, equalise, separate the delay."""

from __future__ import annotations

import warnings
from math import gcd

import numpy as np
import scipy.signal
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.hearing.head_response import HeadResponse, minimum_phase
from veca_marl.sim.hearing.sofa import MeasuredHead, SofaError
from veca_marl.sim.hearing.spherical_head import sphere_response, woodworth_arrival_s
from veca_marl.sim.sound.acoustics import SPEED_OF_SOUND_MPS

USUAL_RADIUS_M = (0.06, 0.11)
POSSIBLE_RADIUS_M = (0.04, 0.16)
_BEFORE_PEAK_S, _AFTER_PEAK_S, _FADE_OUT_S = 1.5e-3, 4.0e-3, 2.0e-3
_BLEND_HZ = (150.0, 350.0)
_TOP_OF_BAND = 0.47
_ARRIVAL_BAND_HZ = (300.0, 3000.0)
_ARRIVAL_UPSAMPLING = 16
_ARRIVAL_OUTLIER_S = 0.25e-3
_MEDIAN_PLANE = 0.15
_FAR_FIELD_M = 0.3


def condition(
    measured: MeasuredHead, sample_rate_hz: int, n_taps: int = 128, licence: str = ""
) -> HeadResponse:
    """Turn a measured head into its compact form.

    Keeps the response about its peak, divides by the diffuse field (the mean over all directions,
    Moller 1992), puts the sphere's response where loudspeakers are mute (below 150 Hz), and
    separates the arrival time from the minimum-phase filter.

    Args:
        measured: From `read_sofa`.
        sample_rate_hz: Rate of the result.
        n_taps: Length of the filters; 128 at 22 050 Hz keep 0.07 dB rms below 5.4 kHz.
        licence: Terms and authors of the measurement, kept with the result.

    Raises:
        SofaError: If the arrival times are not those of a head.
    """
    responses = _window(_resample(measured, sample_rate_hz), sample_rate_hz)
    n_fft = max(1024, 1 << (responses.shape[-1] - 1).bit_length())
    magnitude = np.abs(np.fft.rfft(responses, n_fft)).astype(np.float64)
    frequency = np.fft.rfftfreq(n_fft, 1.0 / sample_rate_hz).astype(np.float64)
    incidence = ear_incidence(measured.directions)
    arrival_s, radius_m = _arrivals(measured, responses, magnitude, incidence, sample_rate_hz)
    equalised = magnitude / _diffuse_field(magnitude, frequency, measured.directions)
    blended = _blend_with_sphere(equalised, frequency, incidence, measured.distance_m)
    top = int(_TOP_OF_BAND * n_fft)
    blended[..., top:] = blended[..., top : top + 1]
    filters = minimum_phase(blended, n_taps) * _fade_out(n_taps)
    return HeadResponse(
        measured.directions,
        filters.astype(np.float32),
        arrival_s,
        sample_rate_hz,
        radius_m,
        licence,
    )


def ear_incidence(directions: Floats) -> Floats:
    """Return the angles ``(..., 2)`` between unit vectors ``(..., 3)`` and the ears' axes."""
    left = np.clip(directions[..., 1], -1.0, 1.0)
    incidence: Floats = np.stack([np.arccos(left), np.arccos(-left)], axis=-1)
    return incidence


def _resample(measured: MeasuredHead, sample_rate_hz: int) -> Floats:
    rate = round(measured.sample_rate_hz)
    if rate == sample_rate_hz:
        return measured.impulse_responses
    common = gcd(rate, sample_rate_hz)
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
    """Keep -1.5 to +6 ms about the peak; the rest of a measurement is the room and noise."""
    peak = np.abs(responses).argmax(axis=-1)[..., None]
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
    """Return each direction's share ``(M,)`` of the sphere, by the points nearest to it."""
    index = np.arange(n_points) + 0.5
    height = 1.0 - 2.0 * index / n_points
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - height**2)
    points = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), height], axis=1)
    nearest = cKDTree(directions).query(points)[1]
    return np.bincount(nearest, minlength=len(directions)) / n_points


def _blend_with_sphere(
    magnitude: Floats, frequency: Floats, incidence: Floats, distance_m: float
) -> Floats:
    """Replace what lies below the loudspeaker's band by the response of a sphere."""
    low_hz, high_hz = _BLEND_HZ
    octave = np.log(np.maximum(frequency, 1.0) / low_hz) / np.log(high_hz / low_hz)
    measured_share = np.clip(octave, 0.0, 1.0)
    n_low = int(np.searchsorted(frequency, high_hz))
    angles = np.linspace(0.0, np.pi, 37)
    distance_m = distance_m if distance_m > _FAR_FIELD_M else 1.4
    table = np.abs(sphere_response(angles, frequency[:n_low], distance_m=distance_m))
    sphere = np.stack([np.interp(incidence, angles, column) for column in table.T], axis=-1)
    share = measured_share[:n_low]
    blended = magnitude.copy()
    log_measured = np.log(np.maximum(magnitude[..., :n_low], 1e-5))
    blended[..., :n_low] = np.exp(share * log_measured + (1.0 - share) * np.log(sphere))
    return blended


def _arrivals(
    measured: MeasuredHead,
    responses: Floats,
    magnitude: Floats,
    incidence: Floats,
    sample_rate_hz: int,
) -> tuple[Floats, float]:
    """Return arrival times ``(M, 2)`` in s and the radius of the sphere that fits them in m."""
    correlation = _correlate_with_minimum_phase(responses, magnitude, sample_rate_hz)
    lag_s = np.arange(correlation.shape[-1]) / (_ARRIVAL_UPSAMPLING * sample_rate_hz)
    arrival_s = lag_s[correlation.argmax(axis=-1)] + measured.delays_s
    median_plane = np.abs(measured.directions[:, 1]) < _MEDIAN_PLANE
    if not median_plane.any():
        raise SofaError(f"{measured.source}: has no directions near the median plane")
    centre_s = float(np.median(arrival_s[median_plane]))
    per_metre = woodworth_arrival_s(incidence, 1.0)
    lateral = np.abs(per_metre) > 0.4 / SPEED_OF_SOUND_MPS
    radius_m = float(np.median((arrival_s - centre_s)[lateral] / per_metre[lateral]))
    _check_radius(radius_m, measured.source)
    expected_s = centre_s + radius_m * per_metre
    for m, ear in zip(
        *np.nonzero(np.abs(arrival_s - expected_s) > _ARRIVAL_OUTLIER_S), strict=True
    ):
        expected_lag = expected_s[m, ear] - measured.delays_s[m, ear]
        near = np.abs(lag_s - expected_lag) < _ARRIVAL_OUTLIER_S
        best = lag_s[near][correlation[m, ear, near].argmax()] if near.any() else expected_lag
        arrival_s[m, ear] = best + measured.delays_s[m, ear]
    return arrival_s - arrival_s[median_plane].mean(), radius_m


def _correlate_with_minimum_phase(
    responses: Floats, magnitude: Floats, sample_rate_hz: int
) -> NDArray[np.float64]:
    """Correlate each response with its own minimum-phase form; the peak is at its pure delay.

    An inverted measurement turns all peaks downward: their common sign is taken out.
    """
    n = responses.shape[-1]
    frequency = np.fft.rfftfreq(2 * n, 1.0 / sample_rate_hz)
    reference = np.fft.rfft(minimum_phase(magnitude, n), 2 * n)
    low_hz, high_hz = _ARRIVAL_BAND_HZ
    weight = (frequency < high_hz) * np.minimum(1.0, frequency / low_hz)
    spectrum = np.fft.rfft(responses, 2 * n) * np.conj(reference) * weight
    n_fine = n * _ARRIVAL_UPSAMPLING
    correlation = np.fft.irfft(spectrum, 2 * n_fine)[..., :n_fine]
    peaks = np.take_along_axis(correlation, np.abs(correlation).argmax(-1)[..., None], axis=-1)
    signed: NDArray[np.float64] = correlation * np.sign(peaks.sum())
    return signed


def _check_radius(radius_m: float, source: str) -> None:
    if not POSSIBLE_RADIUS_M[0] <= radius_m <= POSSIBLE_RADIUS_M[1]:
        raise SofaError(
            f"{source}: the arrival times fit a head of radius {radius_m * 100:.1f} cm; "
            f"that is no head (wrong sampling rate, swapped axes or no HRTF)"
        )
    if not USUAL_RADIUS_M[0] <= radius_m <= USUAL_RADIUS_M[1]:
        warnings.warn(
            f"{source}: the arrival times fit a head of radius {radius_m * 100:.1f} cm, usual are "
            f"6 to 11 cm; is the sampling rate right?",
            stacklevel=4,
        )
