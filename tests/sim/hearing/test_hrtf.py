from dataclasses import replace

import numpy as np
import pytest
from listening import RATE, direction
from paths import ROOT, SHARED

from veca_marl.sim.hearing import HrtfReceiver, HrtfTable, condition, kemar_table, read_sofa
from veca_marl.sim.hearing.head_response import HeadResponse, minimum_phase
from veca_marl.sim.hearing.hrtf import direction_vectors, stand_ins
from veca_marl.sim.hearing.spherical_head import (
    HEAD_RADIUS_M,
    ear_incidence,
    sphere_response,
    woodworth_arrival_s,
)

DATA = ROOT / "veca_marl/data/kemar.npz"
KEMAR_SOFA = SHARED / "data/hrtf/MIT_KEMAR_normal_pinna.sofa"
N_FFT = 1024
FREQUENCY = np.fft.rfftfreq(N_FFT, 1.0 / RATE)


def sphere_head(n_taps=128):
    angles = np.linspace(0.0, np.pi, 91)
    magnitude = np.abs(sphere_response(angles, FREQUENCY))
    filters = minimum_phase(magnitude, n_taps)
    azimuth = np.deg2rad(np.arange(0, 360, 10))
    elevation = np.deg2rad(np.arange(-80, 90, 10))
    directions = direction_vectors(azimuth, elevation).reshape(-1, 3)
    incidence = ear_incidence(directions)
    row = np.rint(np.rad2deg(incidence) / 2.0).astype(int)
    return HeadResponse(
        directions,
        filters[row].astype(np.float32),
        woodworth_arrival_s(incidence),
        RATE,
        HEAD_RADIUS_M,
        1.4,
        "",
    )


def level_db(table, azimuth_deg, elevation_deg=0.0):
    """Levels of both ears (2, F) at the measured distance, interpolated as in the stream."""
    head = HrtfReceiver(table)
    delays, filters = np.zeros((1, 2)), np.zeros((1, 2, head.n_taps), np.float32)
    where = table.measured_at_m * direction(azimuth_deg, elevation_deg)[None]
    head.write_paths(where, np.full(1, table.measured_at_m), RATE, delays, filters)
    return 20.0 * np.log10(np.abs(np.fft.rfft(filters[0], N_FFT)))


def band(low_hz, high_hz):
    return (low_hz <= FREQUENCY) & (high_hz > FREQUENCY)


def test_the_packaged_head_contains_its_licence():
    head = HeadResponse.load(DATA)
    for word in ("1994", "MIT", "Gardner", "Martin", "cited", "Modified"):
        assert word in head.licence
    assert kemar_table().licence == head.licence
    assert DATA.stat().st_size < 250_000


def test_the_packaged_head_equals_the_output_of_the_script():
    if not KEMAR_SOFA.exists():
        pytest.skip("the KEMAR SOFA file is not here")
    made = condition(read_sofa(KEMAR_SOFA), RATE, 128)
    shipped = HeadResponse.load(DATA)
    assert np.abs(made.filters - shipped.filters).max() < 1e-3
    assert np.abs(made.arrival_s - shipped.arrival_s).max() < 1e-7
    assert made.head_radius_m == pytest.approx(0.087, abs=0.002)


def test_the_table_reproduces_the_measured_responses():
    head, table = HeadResponse.load(DATA), kemar_table()
    heard = band(200, 5384)
    measured = 20.0 * np.log10(np.abs(np.fft.rfft(head.filters, N_FFT))[..., heard])
    errors = []
    for i in range(0, len(head.directions), 7):
        x, y, z = head.directions[i]
        azimuth, elevation = np.rad2deg(np.arctan2(y, x)), np.rad2deg(np.arcsin(z))
        errors.append(level_db(table, azimuth, elevation)[:, heard] - measured[i])
    assert np.sqrt(np.mean(np.square(errors))) < 0.2


def test_the_head_is_symmetric():
    """KEMAR's right ear is a mirror of its left: mirrored sounds swap the ears."""
    table = kemar_table()
    for azimuth in (0, 30, 77, 150):
        assert np.allclose(level_db(table, azimuth), level_db(table, -azimuth)[::-1], atol=0.05)


def test_low_frequencies_pass_unchanged():
    levels = [level_db(kemar_table(), azimuth)[:, 1] for azimuth in range(0, 360, 30)]
    assert np.abs(levels).max() < 1.5


def test_level_difference_grows_with_frequency():
    level = level_db(kemar_table(), 60.0)
    difference = level[0] - level[1]
    bands = [(200, 500), (500, 1000), (1000, 2000), (4000, 5400)]
    d = [difference[band(*edges)].mean() for edges in bands]
    assert d[0] < 5.0
    assert d[0] < d[1] < d[2]
    assert d[3] > 12.0


@pytest.mark.slow
@pytest.mark.parametrize(("head", "low", "high"), [("kemar", 3.0, 9.0), ("sphere", 0.0, 0.05)])
def test_front_and_back_differ_by_the_pinna_only(head, low, high):
    table = kemar_table() if head == "kemar" else HrtfTable(sphere_head())
    difference = (level_db(table, 30.0) - level_db(table, 150.0))[:, band(2000, 5400)]
    assert low <= np.sqrt(np.mean(difference**2)) <= high


def test_arrival_times_are_continuous_at_the_lowest_ring():
    """KEMAR ends at -40 degrees: a step to the next row below is none of the largest ones."""
    steps = np.abs(np.diff(kemar_table().arrival_samples, axis=1)).max(axis=(0, 2))
    assert steps[9] < steps[10]
    assert steps[:10].max() < 1e-3 * RATE * 0.03


@pytest.mark.slow
@pytest.mark.parametrize("n_taps", [100, 300, 700])
def test_filters_of_any_length_keep_their_magnitudes(n_taps):
    """At 96 kHz a head has filters of 557 samples; all of them are interpolated alike."""
    head = sphere_head()
    filters = np.zeros((*head.filters.shape[:2], n_taps), np.float32)
    filters[..., : min(n_taps, 128)] = head.filters[..., :n_taps]
    table = HrtfTable(replace(head, filters=filters))
    row = int((head.directions @ direction(90.0, 0.0)).argmax())
    found, measured = (np.abs(np.fft.rfft(f, 2048)) for f in (table.filters[18, 18], filters[row]))
    assert table.filters.shape[-1] == n_taps
    assert np.abs(20.0 * np.log10(found / measured)).max() < 0.5


def test_arrival_times_at_the_nadir_depend_neither_on_azimuth_nor_ear():
    times = kemar_table().arrival_samples[:, 0]
    assert np.allclose(times, times[0, 0], atol=1e-6)


@pytest.mark.slow
def test_arrival_times_below_the_ring_of_a_sphere_are_those_of_the_sphere():
    head = sphere_head()
    kept = head.directions[:, 2] > np.sin(np.deg2rad(-41.0))
    cut = replace(
        head,
        directions=head.directions[kept],
        filters=head.filters[kept],
        arrival_s=head.arrival_s[kept],
    )
    below = HrtfTable(cut).arrival_samples[:, :10]
    directions = direction_vectors(
        np.deg2rad(np.arange(0, 360, 5)), np.deg2rad(np.arange(-90, -40, 5))
    )
    expected = RATE * woodworth_arrival_s(ear_incidence(directions), HEAD_RADIUS_M)
    assert np.allclose(below, expected, atol=0.02)


def test_the_lowest_ring_has_its_measured_arrival_times():
    head, table = HeadResponse.load(DATA), kemar_table()
    row = int((head.directions @ direction(90.0, -40.0)).argmax())
    assert table.arrival_samples[18, 10] == pytest.approx(RATE * head.arrival_s[row], abs=0.02)


def interaural_level_db(azimuth_deg, elevation_deg):
    left, right = level_db(kemar_table(), azimuth_deg, elevation_deg)[:, band(1000, 5400)]
    return float((left - right).mean())


def test_a_source_under_the_head_has_hardly_any_interaural_difference():
    """The azimuth is undefined at the nadir; the lateral angle decides."""
    for azimuth in range(0, 360, 45):
        assert abs(interaural_level_db(azimuth, -90.0)) < 0.5
        assert abs(interaural_level_db(azimuth, -80.0)) < 4.0
    sideways = [interaural_level_db(90.0, elevation) for elevation in (-80, -70, -60, -50, -40)]
    assert (np.diff(sideways) > 0.0).all()


def test_responses_are_continuous_under_the_head():
    """From the front under the head to the back, in steps of 5 degrees."""
    path = [(0.0, -e) for e in range(30, 91, 5)] + [(180.0, -e) for e in range(85, 29, -5)]
    levels = np.stack([level_db(kemar_table(), *place) for place in path])[:, 0, band(500, 5400)]
    steps = np.sqrt(np.mean(np.diff(levels, axis=0) ** 2, axis=1))
    assert steps.max() < 2.0


@pytest.mark.parametrize("ring_deg", [-10.0, -40.0, -80.0])
def test_directions_below_a_ring_keep_their_lateral_angle(ring_deg):
    rng = np.random.default_rng(0)
    below = rng.standard_normal((2000, 3))
    below /= np.linalg.norm(below, axis=1, keepdims=True)
    below = below[below[:, 2] < np.sin(np.deg2rad(ring_deg))]
    ring, weights = stand_ins(below, np.deg2rad(ring_deg))
    assert np.allclose(np.linalg.norm(ring, axis=-1), 1.0)
    assert np.allclose(ring[..., 1], below[:, None, 1])
    assert np.allclose(ring[..., 2], np.sin(np.deg2rad(ring_deg)))
    assert np.allclose(weights.sum(axis=-1), 1.0)
    assert (weights >= 0.0).all()
    on_ring, alone = stand_ins(ring[:, 1], np.deg2rad(ring_deg))
    assert np.allclose(on_ring[:, 1], ring[:, 1])
    assert np.allclose(alone[np.abs(ring[:, 1, 0]) > 1e-3], (0.0, 1.0), atol=1e-6)


def test_the_table_is_shared_and_read_only():
    assert kemar_table() is kemar_table()
    with pytest.raises(ValueError, match="read-only"):
        kemar_table().filters[0] = 0.0


def test_other_sampling_rates_are_refused():
    with pytest.raises(ValueError, match="48000"):
        kemar_table(48_000)
    with pytest.raises(ValueError, match="16000"):
        HrtfReceiver(kemar_table()).write_paths(np.ones((1, 3)), np.ones(1), 16_000, None, None)


def test_the_sphere_has_the_known_limits():
    """Duda & Martens 1998: no effect at 0 Hz; pressure doubled at the pole facing the source."""
    response = sphere_response(np.deg2rad([0, 90, 180]), [50.0, 8000.0], distance_m=100.0)
    level = 20.0 * np.log10(np.abs(response))
    assert np.abs(level[:, 0]).max() < 0.3
    assert level[0, 1] == pytest.approx(6.02, abs=0.3)


def test_the_sphere_delays_as_kuhn_and_woodworth():
    """Kuhn 1977: 3a/c sin at low frequency, Woodworth's ray at high frequency."""
    ears = np.deg2rad([45.0, 135.0])
    for frequency, factor in ((100.0, 1.5), (6000.0, 1.0)):
        around = np.array([0.999, 1.001]) * frequency
        phase = np.unwrap(np.angle(sphere_response(ears, around, distance_m=100.0)), axis=1)
        delay = -np.diff(phase, axis=1)[:, 0] / (2 * np.pi * np.diff(around)[0])
        if factor == 1.5:
            expected = 3.0 * HEAD_RADIUS_M / 343.0 * np.sin(np.pi / 4)
        else:
            near, far = woodworth_arrival_s(ears)
            expected = far - near
        assert delay[1] - delay[0] == pytest.approx(expected, rel=0.05)


def test_minimum_phase_keeps_the_magnitude_and_has_the_least_delay():
    magnitude = np.abs(np.fft.rfft([1.0, -0.4, 0.2], 512))
    assert np.allclose(minimum_phase(magnitude, 3), [1.0, -0.4, 0.2], atol=1e-6)
    late = np.abs(np.fft.rfft([0.2, -0.4, 1.0], 512))
    assert minimum_phase(late, 4)[0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
def test_a_saved_head_response_is_loaded_unchanged(tmp_path):
    head = sphere_head(32)
    head.save(tmp_path / "head.npz")
    again = HeadResponse.load(tmp_path / "head.npz")
    assert np.allclose(again.filters, head.filters, atol=1e-3)
    numbers = (again.sample_rate_hz, again.head_radius_m, again.measured_at_m)
    assert numbers == (RATE, HEAD_RADIUS_M, 1.4)
