"""Conditioning of measured impulse responses: window, resample, equalise, separate the delay."""

from __future__ import annotations

import math

import numpy as np
import scipy.signal
from scipy.spatial import cKDTree

from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing.arrival_times import arrival_times
from veca_marl.sim.hearing.head_response import HeadResponse
from veca_marl.sim.hearing.minimum_phase import minimum_phase
from veca_marl.sim.hearing.sofa import MeasuredHead
from veca_marl.sim.hearing.spherical_head import ear_incidence, sphere_response

# window around the peak: seconds before it, seconds after it, and length of the fade-out
_BEFORE_PEAK_S, _AFTER_PEAK_S, _FADE_OUT_S = 1.5e-3, 4.0e-3, 2.0e-3
_SHORT_S = 0.02
_FILTER_S = 128 / 22_050
# below the first frequency the response is that of the sphere, above the second the measured one
_BLEND_HZ = (150.0, 350.0)
# fraction of the sampling rate above which the anti-aliasing filter would be equalised
_TOP_OF_BAND = 0.47


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
