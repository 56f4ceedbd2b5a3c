"""Sources near the head: levels at both ears against the series for a rigid sphere."""

from __future__ import annotations

import numpy as np

from tools.fidelity.law import Curve, Mark, Plot, Section, at_most
from veca_marl.sim.geometry import Floats
from veca_marl.sim.hearing import HrtfReceiver, kemar_table
from veca_marl.sim.hearing.spherical_head import sphere_response
from veca_marl.sim.sound import SAMPLE_RATE_HZ

_TEXT = """
A source in the horizontal plane comes nearer. The level at each ear, relative to 1/d, changes from
that at {reference:g} m, where KEMAR was measured, against the series of Duda & Martens (1998) for a
rigid sphere of KEMAR's radius, on the side of the source and on the other. The level that is
rendered has the change at low frequency for all frequencies; the sphere's shadow is deeper at high
frequency.
"""
DISTANCES_M = (0.12, 0.15, 0.2, 0.3, 0.5, 1.0, 3.0)
AZIMUTHS_DEG = tuple(range(0, 181, 15))
LOW_HZ, ALL_HZ = (200.0, 500.0), (200.0, 5400.0)


def rendered_change_db(
    distance_m: float, azimuth_deg: float, band_hz: tuple[float, float]
) -> Floats:
    """Return by how much the levels ``(2,)`` times d differ from those at the measured distance."""
    return _rendered_db(distance_m, azimuth_deg, band_hz) - _rendered_db(
        kemar_table().measured_at_m, azimuth_deg, band_hz
    )


def sphere_change_db(distance_m: float, azimuth_deg: float, band_hz: tuple[float, float]) -> Floats:
    """Return the same of a rigid sphere, as the mean over the band."""
    table = kemar_table()
    to_left = np.arccos(np.sin(np.deg2rad(azimuth_deg)))
    ears, frequency = np.array([to_left, np.pi - to_left]), np.geomspace(*band_hz, 8)
    near, far = (
        np.abs(sphere_response(ears, frequency, table.head_radius_m, at_m))
        for at_m in (distance_m, table.measured_at_m)
    )
    change: Floats = 20.0 * np.log10(near / far).mean(axis=1)
    return change


def errors_db(distance_m: float, band_hz: tuple[float, float]) -> Floats:
    """Return rendered minus sphere, ``(azimuths, 2)``."""
    return np.stack(
        [
            rendered_change_db(distance_m, azimuth, band_hz)
            - sphere_change_db(distance_m, azimuth, band_hz)
            for azimuth in AZIMUTHS_DEG
        ]
    )


def section() -> Section:
    """Measure all of this page."""
    laws = []
    for distance_m in DISTANCES_M:
        low = float(np.abs(errors_db(distance_m, LOW_HZ)).max())
        rms = float(np.sqrt((errors_db(distance_m, ALL_HZ) ** 2).mean()))
        where = f"{distance_m:g} m"
        laws.append(at_most(f"{where}, 200 to 500 Hz, largest error", "dB", 0.8, low))
        laws.append(at_most(f"{where}, 200 to 5400 Hz, rms error", "dB", 2.0, rms))
    text = _TEXT.format(reference=kemar_table().measured_at_m)
    return Section("Near sources", text, laws, [_plot()])


def _rendered_db(distance_m: float, azimuth_deg: float, band_hz: tuple[float, float]) -> Floats:
    receiver, azimuth = HrtfReceiver(kemar_table()), np.deg2rad(azimuth_deg)
    arrivals = distance_m * np.array([[np.cos(azimuth), np.sin(azimuth), 0.0]])
    delays, filters = np.empty((1, 2)), np.empty((1, 2, receiver.n_taps), np.float32)
    receiver.write_paths(arrivals, np.ones(1), SAMPLE_RATE_HZ, delays, filters)
    frequency = np.fft.rfftfreq(1024, 1.0 / SAMPLE_RATE_HZ)
    band = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    level: Floats = 20.0 * np.log10(np.abs(np.fft.rfft(filters[0], 1024))[:, band]).mean(axis=1)
    scaled: Floats = level + 20.0 * np.log10(distance_m)
    return scaled


def _plot() -> Plot:
    curves = []
    for row, side in enumerate(("side of the source", "other side")):
        for label, change, mark in (
            ("sphere", sphere_change_db, Mark.line),
            ("rendered", rendered_change_db, Mark.points),
        ):
            levels = [float(change(at_m, 60.0, LOW_HZ)[row]) for at_m in DISTANCES_M]
            curves.append(Curve(f"{side}, {label}", DISTANCES_M, levels, mark))
    return Plot(
        "Level at the ears, azimuth 60 degrees",
        "distance (m)",
        f"level times distance, relative to {kemar_table().measured_at_m:g} m (dB)",
        curves,
        log_x=True,
    )
