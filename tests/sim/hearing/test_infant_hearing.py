"""Thresholds of hearing of a child: what it does not hear is not in its observation."""

import numpy as np
import pytest
from refusals import naming

from veca_marl.sim.hearing import AudioCfg, Encoding, Window
from veca_marl.sim.hearing.encodings import WINDOW_SAMPLES, make_encoder
from veca_marl.sim.hearing.infant_hearing import FULL_SCALE_DB_SPL, threshold_db_spl
from veca_marl.sim.sound import SAMPLE_RATE_HZ

BIN_HZ = SAMPLE_RATE_HZ / WINDOW_SAMPLES
FREQUENCIES = np.array([250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0])


def tone(hertz, db_spl):
    """Samples at both ears of a tone in the middle of a bin."""
    rms = 10.0 ** ((db_spl - FULL_SCALE_DB_SPL) / 20.0)
    wave = np.sqrt(2.0) * rms * np.sin(2.0 * np.pi * hertz / SAMPLE_RATE_HZ * np.arange(1024))
    return np.stack([wave, wave]).astype(np.float32)


def encoder(age_months, encoding=Encoding.magnitude, window=Window.rectangular):
    return make_encoder(encoding, window, None, 513, age_months)


@pytest.mark.parametrize(
    ("age_months", "hertz", "measured_db"),
    [(0.75, 500.0, 56.0), (0.75, 4000.0, 41.0), (6.0, 1000.0, 24.0), (12.0, 4000.0, 15.0)],
)
def test_thresholds_are_those_of_the_sources(age_months, hertz, measured_db):
    assert threshold_db_spl(age_months, np.array([hertz])) == pytest.approx(measured_db)


def test_thresholds_fall_with_age_to_those_of_adults():
    ages = np.geomspace(0.5, 80.0, 60)
    levels = np.array([threshold_db_spl(age, FREQUENCIES) for age in ages])
    assert np.all(np.diff(levels, axis=0) <= 1e-9)
    np.testing.assert_allclose(levels[-1], 10.0)


@pytest.mark.parametrize("window", list(Window))
@pytest.mark.parametrize("age_months", [1.0, 8.0, 36.0])
@pytest.mark.parametrize("number", [12, 47, 186])
def test_a_tone_at_the_threshold_is_as_loud_as_the_noise_and_a_fainter_one_is_lost(
    window, age_months, number
):
    child, hertz = encoder(age_months, window=window), number * BIN_HZ
    silence = child.encode(np.zeros((2, 1024), np.float32))[0, number]
    level = float(threshold_db_spl(age_months, np.array([hertz]))[0])
    rises = [
        child.encode(tone(hertz, level + db))[0, number] - silence for db in (-20.0, 0.0, 40.0)
    ]
    assert rises[0] < 0.003
    assert rises[1] == pytest.approx(np.log10(2.0) / 2.0, abs=0.01)
    assert rises[2] == pytest.approx(2.0, abs=0.01)


def test_a_child_does_not_hear_from_where_a_faint_tone_comes():
    number = 20
    ages = (None, 1.0)
    adult, child = (
        encoder(age, Encoding.magnitude_phase).encode(tone(number * BIN_HZ, 20.0)) for age in ages
    )
    assert adult[2, number] > 0.9
    assert child[2, number] < 0.01


@pytest.mark.parametrize("age_months", [0.0, -1.0, np.inf, np.nan])
def test_impossible_ages_are_refused(age_months):
    with pytest.raises(ValueError, match=naming("infant_age_months", age_months)):
        AudioCfg(infant_age_months=age_months)
