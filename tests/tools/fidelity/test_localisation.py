"""Localisation by ear: the errors, and the order of the qualities with few scenes."""

import numpy as np
import pytest

from tools.fidelity.hearing.localisation import ARMS, errors, localisation


def test_a_confusion_of_front_and_back_leaves_the_lateral_angle_unchanged():
    true = np.deg2rad([10.0, 40.0, -30.0, 170.0])
    found = errors(np.pi - true, true)
    assert found.lateral_deg == pytest.approx(0.0, abs=1e-6)
    assert found.confused == 1.0
    assert found.azimuth_deg == pytest.approx(np.mean([160.0, 100.0, 120.0, 160.0]))


def test_azimuths_near_the_ear_axis_are_not_counted_as_confusions():
    found = errors(np.deg2rad([95.0, 10.0]), np.deg2rad([85.0, 20.0]))
    assert found.confused == 0.0
    assert found.azimuth_deg == pytest.approx(10.0)


def test_the_difference_of_azimuths_is_wrapped():
    found = errors(np.deg2rad([-179.0]), np.deg2rad([179.0]))
    assert found.azimuth_deg == pytest.approx(2.0)
    assert found.confused == 0.0


@pytest.mark.slow
def test_the_direction_is_found_with_a_head_and_not_with_one_receiver():
    hrtf, stereo, mono = (
        localisation(ARMS[name], train=600, test=300) for name in ("hrtf", "stereo", "mono")
    )
    assert hrtf.azimuth_deg < 45.0
    assert hrtf.confused < 0.3
    assert stereo.azimuth_deg > hrtf.azimuth_deg + 15.0
    assert stereo.confused > 0.35
    assert mono.azimuth_deg > 75.0


@pytest.mark.slow
def test_the_time_between_the_ears_tells_the_side_without_a_head():
    names = ("stereo", "stereo_phase", "mono_phase")
    level, phase, mono = (localisation(ARMS[name], train=600, test=300) for name in names)
    assert phase.lateral_deg < level.lateral_deg - 12.0
    assert phase.confused > 0.35  # front and back have the same time
    assert mono.azimuth_deg > 75.0
