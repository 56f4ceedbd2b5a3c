"""The size of the head: scaled responses, and the same head for all qualities of hearing."""

import numpy as np
import pytest
from composed import compose
from listening import RATE
from refusals import naming

from tools.fidelity.hearing.ears import (
    heard_noise,
    interaural_level_db,
    interaural_time_s,
    measured_at,
    scaling_errors,
    two_points_itd_s,
)
from veca_marl.sim.body.sense_organs import MOUNTS_M
from veca_marl.sim.hearing import AudioCfg, AudioQuality, HrtfTable, kemar_table
from veca_marl.sim.hearing.audio_sense import make_receiver
from veca_marl.sim.hearing.hrtf import kemar_response


@pytest.mark.parametrize("scale", [0.5, 0.733, 1.2, 1.5])
def test_a_scaled_head_has_its_spectrum_at_other_frequencies_and_other_times(scale):
    rms_db, relative = scaling_errors(scale)
    assert rms_db < 0.2
    assert relative < 1e-9
    radius_m = kemar_response().head_radius_m
    assert kemar_response().scaled(scale).head_radius_m == pytest.approx(scale * radius_m)


def test_a_scale_of_one_is_the_measured_head():
    assert kemar_response().scaled(1.0) is kemar_response()
    assert kemar_table(RATE, 1.0) is kemar_table()
    assert kemar_table().filters.tobytes() == HrtfTable(kemar_response()).filters.tobytes()


@pytest.mark.parametrize("scale", [0.0, -1.0, 0.4, 1.6, np.nan, np.inf])
def test_sizes_that_no_head_has_are_refused(scale):
    with pytest.raises(ValueError, match=naming(f"head_scale={scale}", "0.5", "1.5")):
        AudioCfg(head_scale=scale)
    with pytest.raises(ValueError, match="head_scale"):
        kemar_response().scaled(scale)


@pytest.mark.parametrize("scale", [1.0, 0.733])
def test_stereo_has_the_distance_between_the_ears_of_the_head(scale):
    head = kemar_response().scaled(scale)
    ears = make_receiver(AudioCfg(quality=AudioQuality.stereo, head_scale=scale), RATE).ears
    assert ears[0] == pytest.approx((0.0, head.head_radius_m, 0.0))
    assert ears[1] == pytest.approx((0.0, -head.head_radius_m, 0.0))


@pytest.mark.parametrize("scale", [1.0, 0.733])
def test_the_arms_have_the_interaural_differences_of_one_head(scale):
    head = kemar_response().scaled(scale)
    time_s, filters = measured_at(head, 90.0)
    stereo, hrtf = (
        heard_noise(
            AudioCfg(quality=quality, head_scale=scale), 90.0, distance_m=head.measured_at_m
        )
        for quality in (AudioQuality.stereo, AudioQuality.hrtf)
    )
    two_points_s = two_points_itd_s(90.0, head.head_radius_m)
    assert interaural_time_s(stereo) == pytest.approx(two_points_s, abs=3e-6)
    assert interaural_time_s(hrtf) == pytest.approx(time_s, abs=5e-6)
    band_hz = (1414.0, 2828.0)
    expected_db = interaural_level_db(filters, band_hz)
    assert interaural_level_db(hrtf, band_hz) == pytest.approx(expected_db, abs=0.5)


@pytest.mark.parametrize("preset", ["hrtf_child", "stereo_child"])
def test_the_child_presets_have_the_ears_of_the_bodies(preset):
    cfg = compose(["+task=KickTheBall", f"senses/audio={preset}"]).senses.audio
    diameter_m = 2.0 * cfg.head_scale * kemar_response().head_radius_m
    left, right = (np.array(MOUNTS_M[f"ear_{side}"]) for side in ("left", "right"))
    assert diameter_m == pytest.approx(np.linalg.norm(left - right), abs=1e-3)
