"""Acuity, disparity, segmentation and defocus against their theory, with few cases."""

import numpy as np
import pytest

from tools.fidelity import vision


@pytest.mark.parametrize("age_months", [1.0, 6.0, 48.0])
def test_acuity_is_that_of_the_teller_cards(age_months):
    assert vision.measured_acuity_cpd(age_months) == pytest.approx(
        vision.TELLER_CPD[age_months], rel=0.05
    )


def test_disparity_is_that_of_the_geometry():
    pairs = np.array([vision.disparity_deg(d, vision.FIXATION_M) for d in (0.2, 2.0)])
    assert vision.disparity_law(*pairs.T).holds
    assert pairs[0, 0] > 5.0 > 0.0 > pairs[1, 0]


@pytest.mark.slow
def test_segmentation_is_that_of_tiny_renderer():
    shares = {name: vision.equal_shares(60, shapes) for name, (shapes, _) in vision.ROOMS.items()}
    broken = [law for law in vision.segmentation_laws(shares) if not law.holds]
    assert not broken
    assert vision.outside_law(vision.pixels_outside_balls(12)).holds


@pytest.mark.parametrize("pupil_mm", vision.PUPILS_MM)
def test_blur_discs_are_those_of_a_thin_lens(pupil_mm):
    _, law = vision.defocus_errors(pupil_mm)
    assert law.holds, law
