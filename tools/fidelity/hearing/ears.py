"""Two ears on a head: interaural times and levels over azimuth, and the size of the head."""

from __future__ import annotations

import numpy as np

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_most, equals
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing import AudioCfg, AudioQuality
from veca_marl.sim.hearing.audio_sense import make_receiver
from veca_marl.sim.hearing.head_response import HeadResponse
from veca_marl.sim.hearing.hrtf import kemar_response
from veca_marl.sim.hearing.spherical_head import woodworth_arrival_s
from veca_marl.sim.sound import SAMPLE_RATE_HZ, SPEED_OF_SOUND_MPS, Clip, SoundField

_TEXT = """
Noise from {distance:g} m away, rendered as for an agent, in the free field; levels are compared
at {measured:g} m, the distance at which the head was measured.

- **Interaural time**: lag of the peak of the cross-correlation of both ears, {low:g} to {high:g}
  Hz, against that of the measured responses with their arrival times, and against Woodworth's ray
  around a sphere (Woodworth & Schlosberg 1954) with the radius that fits KEMAR, {radius:.4f} m.
  KEMAR is no sphere: its ears lie behind the middle, so that sources slightly behind the ear axis
  lead by more than those in front.
- **Interaural level**: ratio of the powers of both ears in octave bands, against that of the
  measured responses.
- **Stereo** has no head: ears of the same distance 2 r with the times ``2 r sin(azimuth) / c``.
- **Size of the head**: a head scaled by s has all features of its spectrum at 1/s of their
  frequency and interaural times s times as long (Middlebrooks 1999).
"""
DISTANCE_M = 10.0
TIME_BAND_HZ = (1500.0, 5000.0)
LEVEL_BANDS_HZ = ((350.0, 707.0), (707.0, 1414.0), (1414.0, 2828.0), (2828.0, 5400.0))
AZIMUTHS_DEG = tuple(range(-180, 180, 15))
SCALES = (0.6, 0.733, 0.85, 1.15, 1.4)
_STEPS = 10
_N_FFT = 4096
_UPSAMPLING = 16


def heard_noise(
    cfg: AudioCfg, azimuth_deg: float, seed: int = 0, distance_m: float = DISTANCE_M
) -> Floats:
    """Return 0.4 s of white noise at both ears ``(2, n)``, from an azimuth to the left."""
    azimuth = np.deg2rad(azimuth_deg)
    field = SoundField(None)
    noise = np.random.default_rng(seed).standard_normal(SAMPLE_RATE_HZ)
    source = field.add_source("noise", Clip(0.1 * noise))
    source.position = distance_m * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    listener = field.add_listener(make_receiver(cfg, SAMPLE_RATE_HZ))
    field.reset(np.random.default_rng(0))
    head, steps = Pose(np.zeros(3), np.eye(3)), []
    for _ in range(_STEPS):
        field.advance()
        steps.append(listener.render(head))
    return np.concatenate(steps, axis=1).astype(np.float64)


def interaural_time_s(heard: Floats) -> float:
    """Return by how much the left ear leads, from the peak of the cross-correlation."""
    n = max(_N_FFT, heard.shape[1])
    frequency = np.fft.rfftfreq(2 * n, 1.0 / SAMPLE_RATE_HZ)
    band = (frequency >= TIME_BAND_HZ[0]) & (frequency <= TIME_BAND_HZ[1])
    left, right = np.fft.rfft(heard, 2 * n)
    correlation = np.fft.irfft(right * np.conj(left) * band, 2 * n * _UPSAMPLING)
    reach = round(1e-3 * SAMPLE_RATE_HZ * _UPSAMPLING)
    near = np.concatenate([correlation[-reach:], correlation[: reach + 1]])
    return float((near.argmax() - reach) / (SAMPLE_RATE_HZ * _UPSAMPLING))


def interaural_level_db(signals: Floats, band_hz: tuple[float, float]) -> float:
    """Return the level of the left above the right signal ``(2, n)`` in a band."""
    n = max(_N_FFT, signals.shape[1])
    frequency = np.fft.rfftfreq(n, 1.0 / SAMPLE_RATE_HZ)
    band = (frequency >= band_hz[0]) & (frequency < band_hz[1])
    power = (np.abs(np.fft.rfft(signals, n)[:, band]) ** 2).sum(axis=1)
    return float(10.0 * np.log10(power[0] / power[1]))


def measured_at(response: HeadResponse, azimuth_deg: float) -> tuple[float, Floats]:
    """Return the interaural time in s and the filters ``(2, T)`` measured nearest to an azimuth."""
    azimuth = np.deg2rad(azimuth_deg)
    row = int((response.directions @ (np.cos(azimuth), np.sin(azimuth), 0.0)).argmax())
    left_s, right_s = response.arrival_s[row]
    filters = response.filters[row].astype(np.float64)
    return float(right_s - left_s) + interaural_time_s(filters), filters


def woodworth_itd_s(azimuth_deg: float, radius_m: float) -> float:
    """Return Woodworth's interaural time, positive for a source on the left."""
    left = np.arccos(np.clip(np.sin(np.deg2rad(azimuth_deg)), -1.0, 1.0))
    near, far = woodworth_arrival_s(np.array([left, np.pi - left]), radius_m)
    return float(far - near)


def scaling_errors(scale: float) -> tuple[float, float]:
    """Compare a scaled head with its law.

    Returns:
        Rms difference in dB over all directions between ``|H_s(f)|`` and ``|H(s f)|``, from 200 Hz
        to 10 kHz or 10 kHz / s, and the largest relative difference of interaural times.
    """
    head = kemar_response()
    scaled = head.scaled(scale)
    frequency = np.fft.rfftfreq(_N_FFT, 1.0 / SAMPLE_RATE_HZ)
    used = (frequency > 200.0) & (frequency < 10_000.0 / max(scale, 1.0))
    levels = 20.0 * np.log10(np.abs(np.fft.rfft(head.filters, _N_FFT))).reshape(-1, frequency.size)
    found = 20.0 * np.log10(np.abs(np.fft.rfft(scaled.filters, _N_FFT)))[..., used]
    expected = np.stack([np.interp(scale * frequency[used], frequency, row) for row in levels])
    rms_db = float(np.sqrt(np.mean((found.reshape(expected.shape) - expected) ** 2)))
    itd, scaled_itd = (np.diff(one.arrival_s, axis=1) for one in (head, scaled))
    return rms_db, float(np.abs(scaled_itd - scale * itd).max() / np.abs(itd).max())


def section() -> Section:
    """Measure all of this page."""
    head = kemar_response()
    rendered, stereo = (
        [heard_noise(AudioCfg(quality=quality), azimuth) for azimuth in AZIMUTHS_DEG]
        for quality in (AudioQuality.hrtf, AudioQuality.stereo)
    )
    times = {
        "rendered": [interaural_time_s(heard) for heard in rendered],
        "stereo": [interaural_time_s(heard) for heard in stereo],
        "measured head": [measured_at(head, azimuth)[0] for azimuth in AZIMUTHS_DEG],
        "Woodworth": [woodworth_itd_s(azimuth, head.head_radius_m) for azimuth in AZIMUTHS_DEG],
        "two points": [two_points_itd_s(azimuth, head.head_radius_m) for azimuth in AZIMUTHS_DEG],
    }
    text = _TEXT.format(
        distance=DISTANCE_M,
        measured=head.measured_at_m,
        low=TIME_BAND_HZ[0],
        high=TIME_BAND_HZ[1],
        radius=head.head_radius_m,
    )
    hrtf = AudioCfg(quality=AudioQuality.hrtf)
    as_measured = [heard_noise(hrtf, a, distance_m=head.measured_at_m) for a in AZIMUTHS_DEG]
    levels = _levels(head, as_measured)
    laws = [*_time_laws(times), *_level_laws(levels), *_scale_laws()]
    return Section("Two ears", text, laws, [_time_plot(times), _level_plot(levels)])


def two_points_itd_s(azimuth_deg: float, radius_m: float) -> float:
    """Return the interaural time of two points in the free field, a diameter apart."""
    return float(2.0 * radius_m * np.sin(np.deg2rad(azimuth_deg)) / SPEED_OF_SOUND_MPS)


def _levels(head: HeadResponse, rendered: list[Floats]) -> dict[str, list[tuple[float, float]]]:
    """Return by band the rendered and the measured level difference of each azimuth, dB."""
    measured = [measured_at(head, azimuth)[1] for azimuth in AZIMUTHS_DEG]
    return {
        f"{band[0]:.0f} to {band[1]:.0f} Hz": [
            (interaural_level_db(heard, band), interaural_level_db(filters, band))
            for heard, filters in zip(rendered, measured, strict=True)
        ]
        for band in LEVEL_BANDS_HZ
    }


def _time_laws(times: dict[str, list[float]]) -> list[Law]:
    pairs = (
        ("rendered", "measured head", 5.0),
        ("rendered", "Woodworth", 90.0),
        ("stereo", "two points", 3.0),
    )
    laws = [
        at_most(
            f"interaural time, {one} against {other}, largest error",
            "us",
            limit_us,
            1e6 * float(np.abs(np.subtract(times[one], times[other])).max()),
        )
        for one, other, limit_us in pairs
    ]
    left, right = (times["rendered"][AZIMUTHS_DEG.index(azimuth)] for azimuth in (90, -90))
    return [
        *laws,
        equals("interaural time, right against left", "us", 0.0, 1e6 * (left + right), 3),
    ]


def _level_laws(levels: dict[str, list[tuple[float, float]]]) -> list[Law]:
    return [
        at_most(
            f"interaural level, {band}, rendered against measured, largest error",
            "dB",
            1.0,
            max(abs(rendered - measured) for rendered, measured in pairs),
        )
        for band, pairs in levels.items()
    ]


def _scale_laws() -> list[Law]:
    laws = []
    for scale in SCALES:
        rms_db, relative = scaling_errors(scale)
        laws.append(at_most(f"spectra of a head scaled by {scale:g}, rms error", "dB", 0.2, rms_db))
        laws.append(at_most(f"times of a head scaled by {scale:g}", "", 1e-9, relative))
    return laws


def _time_plot(times: dict[str, list[float]]) -> Plot:
    marks = {"rendered": Mark.points, "stereo": Mark.points, "measured head": Mark.line}
    return Plot(
        "Interaural time over azimuth",
        "azimuth, left positive (degrees)",
        "left ear leads by (us)",
        [
            Curve(
                label, AZIMUTHS_DEG, [1e6 * time for time in values], marks.get(label, Mark.dashes)
            )
            for label, values in times.items()
        ],
    )


def _level_plot(levels: dict[str, list[tuple[float, float]]]) -> Plot:
    curves = []
    for band, pairs in levels.items():
        rendered, measured = zip(*pairs, strict=True)
        curves.append(Curve(f"{band}, rendered", AZIMUTHS_DEG, rendered, Mark.points))
        curves.append(Curve(f"{band}, measured head", AZIMUTHS_DEG, measured))
    return Plot(
        "Interaural level over azimuth",
        "azimuth, left positive (degrees)",
        "left ear above right ear (dB)",
        curves,
    )
