"""Near sources: the closed form, the levels at the ears, and the mouth of the bodies."""

import numpy as np
import pytest
from scipy.special import eval_legendre

from tools.fidelity.hearing.near_field import ALL_HZ, LOW_HZ, errors_db
from veca_marl.sim.body.sense_organs import MOUNTS_M
from veca_marl.sim.hearing import HrtfReceiver, MonoReceiver, StereoReceiver, kemar_table
from veca_marl.sim.hearing.receivers import near_field_gain, sphere_gain
from veca_marl.sim.sound import NEAR_FIELD_M, SAMPLE_RATE_HZ


@pytest.mark.parametrize("x", [0.001, 0.1, 0.5, 0.8])
def test_the_closed_form_is_the_sum_of_the_series(x):
    m = np.arange(400)
    for cosine in (-1.0, -0.6, 0.0, 1e-9, 0.3, 1.0):
        series = ((2 * m + 1) / (m + 1) * x**m * eval_legendre(m, cosine)).sum()
        assert sphere_gain(x, cosine) == pytest.approx(series, rel=1e-9)


def test_distant_sources_have_no_correction():
    assert near_field_gain(0.09, 1e4, 1e4, 0.7) == 1.0
    assert near_field_gain(0.09, 1e4, 1.4, 0.0) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    "distance_m",
    [0.3, *(pytest.param(distance_m, marks=pytest.mark.slow) for distance_m in (0.12, 1.0, 3.0))],
)
def test_near_levels_are_those_at_a_rigid_sphere(distance_m):
    """Without a correction the low band is wrong by 14, 3.5, 0.3 and 0.4 dB."""
    assert np.abs(errors_db(distance_m, LOW_HZ)).max() < 0.8
    assert np.sqrt((errors_db(distance_m, ALL_HZ) ** 2).mean()) < 2.0


def levels(receiver, arrival):
    delays = np.empty((1, receiver.n_channels))
    filters = np.empty((1, receiver.n_channels, receiver.n_taps), np.float32)
    receiver.write_paths(np.array([arrival]), np.ones(1), SAMPLE_RATE_HZ, delays, filters)
    assert np.isfinite(filters).all()
    assert (delays >= 0.0).all()
    return np.linalg.norm(filters[0], axis=1)


def sphere_of_directions(n):
    """Directions ``(n, 3)`` all round, evenly spaced."""
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(n)
    flat = np.sqrt(1.0 - height**2)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), height], axis=1)


@pytest.mark.parametrize("scale", [0.733, 1.0, 1.4])
@pytest.mark.parametrize("quality", ["hrtf", "stereo", "mono"])
def test_a_source_that_comes_closer_is_never_softer_at_the_near_ear(quality, scale):
    """From 2 m to the head of the bodies, the ears of which are 0.064 m from its centre."""
    table = kemar_table(SAMPLE_RATE_HZ, scale)
    ear = np.array([0.0, table.head_radius_m, 0.0])
    receiver = {
        "hrtf": lambda: HrtfReceiver(table),
        "stereo": lambda: StereoReceiver(ear, -ear),
        "mono": MonoReceiver,
    }[quality]()
    skin_m = min(table.head_radius_m, MOUNTS_M["ear_left"][1])
    distances_m = np.geomspace(2.0, skin_m, 60)
    for direction in [*np.eye(3), *-np.eye(3), *sphere_of_directions(40)]:
        near = [
            levels(receiver, d * direction)[0 if direction[1] >= 0.0 else -1] for d in distances_m
        ]
        assert (np.diff(near) > -1e-6 * near[-1]).all(), direction


def test_the_difference_of_the_ears_is_continuous_through_the_centre_of_the_head():
    head = HrtfReceiver(kemar_table())
    lateral_m = np.linspace(-0.02, 0.02, 401)
    ratio_db = [20.0 * np.log10(np.divide(*levels(head, (0.05, y, 0.0)))) for y in lateral_m]
    assert np.abs(np.diff(ratio_db)).max() < 0.5


@pytest.mark.parametrize("arrival", [(0.0, 0.0, 0.0), (0.0, 0.0873, 0.0), (1e-6, -1e-9, 0.05)])
def test_sources_inside_the_head_are_finite_and_no_louder_than_at_its_surface(arrival):
    head = HrtfReceiver(kemar_table())
    nearest = levels(head, (0.0, 1.25 * kemar_table().head_radius_m, 0.0)).max()
    assert levels(head, arrival).max() <= 1.5 * nearest


def test_the_gain_is_constant_within_the_distance_of_the_mouth():
    """The mouth is 0.107 m from the ears of the bodies."""
    mouth = np.array(MOUNTS_M["mouth"])
    for side in ("left", "right"):
        distance_m = np.linalg.norm(mouth - np.array(MOUNTS_M[f"ear_{side}"]))
        assert pytest.approx(distance_m, abs=1e-3) == NEAR_FIELD_M
    mono = MonoReceiver(0.107)
    assert levels(mono, (0.02, 0.0, 0.0))[0] == pytest.approx(1.0 / 0.107)
    assert levels(mono, (0.12, 0.0, 0.0))[0] == pytest.approx(1.0 / 0.12)
