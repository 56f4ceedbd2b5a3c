"""Image filters compared with their definitions."""

import math

import numpy as np
import pytest

from veca_marl.sim.vision import Camera
from veca_marl.sim.vision.image_filters import (
    CONTRAST_AT_LIMIT,
    Blur,
    ContrastThreshold,
    Defocus,
    FilterContext,
    Grey,
    InfantVision,
    acuity_blur_deg,
    acuity_cpd,
    colour_gains,
    contrast_threshold,
)

CAMERA = Camera(200, 200, fov_deg=20.0)
AGES = np.arange(0.0, 60.0, 0.25)


def context_of(depth_m=1.0, focal_distance_m=1.0, camera=CAMERA):
    depth = np.full((2, camera.height, camera.width), depth_m, np.float32)
    return FilterContext(camera, depth, focal_distance_m)


def grating(cycles_per_pixel, amplitude=100.0):
    wave = 127.5 + amplitude * np.sin(2 * np.pi * cycles_per_pixel * np.arange(200))
    row = wave.round().astype(np.uint8)[None, None, :, None]
    return np.broadcast_to(row, (2, 200, 200, 3)).copy()


def contrast(images, cycles_per_pixel):
    """Amplitude of a frequency in the middle of the image, over whole periods."""
    row = images[0, 100, 20:180, 0] - images[0, 100, 20:180, 0].mean()
    phase = np.exp(2j * np.pi * cycles_per_pixel * np.arange(len(row)))
    return 2 * abs(np.mean(row * phase))


def coloured():
    return np.random.default_rng(0).integers(0, 256, (2, 200, 200, 3), np.uint8)


def test_a_blur_much_wider_than_the_image_has_a_limit():
    """Windows of OpenCV that grow with the blur took seconds, or did not end."""
    images = np.random.default_rng(0).integers(0, 256, (2, 84, 84, 3), np.uint8)
    wide, wider = (Blur(sigma_deg)(images, context_of()) for sigma_deg in (360.0, 1e9))
    np.testing.assert_array_equal(wide, wider)
    # of each channel: border pixels are replicated, so that their mean, not the image's, is left
    contrasts = wide.std(axis=(1, 2)) / images.std(axis=(1, 2))
    assert contrasts.max() < 0.25


@pytest.mark.parametrize("filtered", [Grey(), Blur(0.5), Defocus(), InfantVision(2.0)])
def test_filters_return_new_images_of_equal_shape_and_dtype(filtered):
    images = coloured()
    before = images.copy()
    out = filtered(images, context_of(focal_distance_m=0.2))
    assert (out.shape, out.dtype) == (images.shape, np.uint8)
    assert not np.shares_memory(out, images)
    np.testing.assert_array_equal(images, before)
    assert (out != images).any()


def test_grey_is_luma_in_every_channel():
    images = coloured()
    out = Grey()(images, context_of())
    np.testing.assert_array_equal(out[..., 0], out[..., 1])
    np.testing.assert_array_equal(out[..., 0], out[..., 2])
    np.testing.assert_allclose(out[..., 0], images @ (0.299, 0.587, 0.114), atol=0.6)


@pytest.mark.parametrize("cycles_per_pixel", [0.025, 0.05, 0.1])
def test_blur_attenuates_a_grating_by_its_transfer_function(cycles_per_pixel):
    cycles_per_degree = cycles_per_pixel / CAMERA.degrees_per_pixel
    images = grating(cycles_per_pixel)
    out = Blur(0.2)(images, context_of())
    expected = math.exp(-2 * math.pi**2 * 0.2**2 * cycles_per_degree**2)
    passed = contrast(out, cycles_per_pixel) / contrast(images, cycles_per_pixel)
    assert passed == pytest.approx(expected, abs=0.012)


def test_blur_is_defined_in_degrees_not_pixels():
    assert Camera(84, 84, 60.0).degrees_per_pixel == pytest.approx(60 / 84, rel=0.12)
    fine = Camera(200, 200, fov_deg=10.0)
    images = grating(0.05)
    coarse_pass, fine_pass = (
        contrast(Blur(0.1)(images, context_of(camera=camera)), 0.05) for camera in (CAMERA, fine)
    )
    assert coarse_pass > fine_pass + 10


def test_defocus_is_sharp_at_the_focal_distance():
    images = coloured()
    np.testing.assert_array_equal(Defocus()(images, context_of(0.7, 0.7)), images)
    np.testing.assert_array_equal(Defocus()(images, context_of(1e6, math.inf)), images)


@pytest.mark.parametrize(("depth_m", "focal_m"), [(0.4, 2.0), (3.0, 0.5), (0.3, math.inf)])
def test_defocus_blurs_by_the_circle_of_confusion(depth_m, focal_m):
    """A uniform depth makes the filter a Gaussian of the variance of the blur disc."""
    pupil_m, frequency = 0.004, 0.05
    disc_rad = pupil_m * abs(1 / depth_m - 1 / focal_m)
    sigma = math.degrees(disc_rad) / 4 / CAMERA.degrees_per_pixel
    images = grating(frequency)
    out = Defocus(pupil_m)(images, context_of(depth_m, focal_m))
    passed = contrast(out, frequency) / contrast(images, frequency)
    # a mixture of two Gaussians of the same mean variance passes a little more
    expected = math.exp(-2 * math.pi**2 * sigma**2 * frequency**2)
    assert expected < 0.97
    assert passed == pytest.approx(expected, abs=0.03)


def test_defocus_does_not_change_the_focused_half():
    look = context_of(1.0, 1.0)
    look.depth[:, :, 100:] = 0.2
    images = grating(0.1)
    out = Defocus()(images, look)
    np.testing.assert_array_equal(out[:, :, :100], images[:, :, :100])
    assert np.ptp(out[0, 100, 120:180, 0]) < 0.7 * np.ptp(images[0, 100, 120:180, 0])


def test_fixed_accommodation_replaces_that_of_the_body():
    images = coloured()
    body_at_half = Defocus()(images, context_of(3.0, 0.5))
    np.testing.assert_array_equal(Defocus(0.004, 2.0)(images, context_of(3.0, 7.0)), body_at_half)
    relaxed = Defocus(0.004, 0.0)(images, context_of(1e6, 0.1))
    np.testing.assert_array_equal(relaxed, images)


def test_a_wider_pupil_defocuses_more():
    images = grating(0.05)
    narrow, wide = (
        contrast(Defocus(pupil_m)(images, context_of(0.4, 2.0)), 0.05) for pupil_m in (0.002, 0.008)
    )
    assert wide < narrow


def test_acuity_and_colour_grow_with_age():
    acuities = [acuity_cpd(age) for age in AGES]
    assert (np.diff(acuities) >= 0).all()
    assert acuity_cpd(1.0) == pytest.approx(0.94)
    assert 5.0 < acuity_cpd(6.0) < 6.0 < acuity_cpd(12.0) < 8.0
    gains = np.array([colour_gains(age) for age in AGES])
    assert (np.diff(gains, axis=0) >= 0).all()
    assert (gains[:, 0] >= gains[:, 1]).all()  # red-green comes before blue-yellow
    np.testing.assert_array_equal(gains[-1], 1.0)


def test_a_grating_at_the_acuity_limit_keeps_the_stated_contrast():
    age_months = 1.0
    frequency = acuity_cpd(age_months) * CAMERA.degrees_per_pixel
    images = grating(frequency)
    out = InfantVision(age_months)(images, context_of())
    passed = contrast(out, frequency) / contrast(images, frequency)
    assert passed == pytest.approx(CONTRAST_AT_LIMIT, abs=0.02)
    assert acuity_blur_deg(2.0) == pytest.approx(acuity_blur_deg(1.0) / 2.0)


def uniform(colour):
    return np.broadcast_to(np.uint8(colour), (2, 200, 200, 3)).copy()


def test_infant_vision_reduces_saturation_and_keeps_luma():
    luma = np.array([0.299, 0.587, 0.114])
    for colour in [(200, 80, 60), (60, 160, 80), (70, 80, 170)]:
        spreads = []
        for age_months in (0.0, 2.0, 6.0, 24.0):
            seen = InfantVision(age_months)(uniform(colour), context_of())[0, 100, 100]
            assert seen @ luma == pytest.approx(colour @ luma, abs=1.0)
            spreads.append(np.ptp(seen.astype(int)))
        assert spreads == sorted(spreads)
        assert spreads[0] < 0.5 * spreads[-1]
    np.testing.assert_array_equal(
        InfantVision(24.0)(uniform((200, 80, 60)), context_of()), uniform((200, 80, 60))
    )


def test_newborns_do_not_tell_blue_from_grey():
    """At birth only the red-green gain is left: a step in blue moves red and blue with luma."""
    seen = InfantVision(0.0)(uniform((100, 100, 200)), context_of())[0, 0, 0].astype(float)
    luma = 100 + 0.114 * 100
    assert seen[2] == pytest.approx(luma, abs=0.6)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Blur(-1.0), "-1.0"),
        (lambda: Blur(math.nan), "nan"),
        (lambda: Defocus(0.0), "pupil_m 0.0"),
        (lambda: Defocus(0.004, -1.0), "accommodation_dpt -1.0"),
        (lambda: Defocus(0.004, math.inf), "accommodation_dpt inf"),
        (lambda: InfantVision(-1.0), "age_months -1.0"),
        (lambda: Defocus()(coloured(), context_of(1.0, 0.0)), "focal_distance_m 0.0"),
        (lambda: Defocus()(coloured(), context_of(1.0, math.nan)), "focal_distance_m nan"),
    ],
)
def test_invalid_parameters_are_refused(make, named):
    with pytest.raises(ValueError, match=named):
        make()


@pytest.mark.parametrize("cycles_per_pixel", [0.2, 0.05, 0.02])
def test_a_contrast_far_above_the_threshold_stays_and_one_far_below_it_goes(cycles_per_pixel):
    """At any scale; a tenth of the threshold leaves a hundredth."""
    for threshold in (0.03, 0.2):
        visible = ContrastThreshold(threshold / 10.0)(grating(cycles_per_pixel), context_of())
        before = contrast(grating(cycles_per_pixel), cycles_per_pixel)
        assert contrast(visible, cycles_per_pixel) == pytest.approx(before, rel=0.05)
    faint = grating(cycles_per_pixel, amplitude=10.0)  # a contrast of 0.08, 0.06 as a mean
    seen = ContrastThreshold(0.6)(faint, context_of())
    assert contrast(seen, cycles_per_pixel) < 0.1 * contrast(faint, cycles_per_pixel)


@pytest.mark.parametrize("cycles_per_pixel", [0.14, 0.1, 0.07, 0.05, 0.035, 0.025])
def test_a_contrast_at_the_threshold_is_seen_in_part(cycles_per_pixel):
    """About 1 - 1 / e of it is left at the threshold, at any scale."""
    faint = grating(cycles_per_pixel, amplitude=20.0)
    left = [
        contrast(ContrastThreshold(times * 20.0 / 127.5)(faint, context_of()), cycles_per_pixel)
        for times in (0.25, 1.0, 4.0)
    ]
    shares = np.array(left) / contrast(faint, cycles_per_pixel)
    assert shares[0] > 0.85
    assert shares[1] == pytest.approx(1.0 - math.exp(-1.0), abs=0.2)
    assert shares[2] < 0.1


@pytest.mark.parametrize("shape", [(2, 84, 84, 3), (1, 5, 7, 3), (1, 9, 31, 3), (1, 1, 1, 3)])
def test_a_uniform_image_has_no_contrast_to_lose(shape):
    images = np.full(shape, 77, np.uint8)
    np.testing.assert_array_equal(ContrastThreshold(0.2)(images, context_of()), images)


def test_infants_see_less_contrast_than_older_ones():
    thresholds = [contrast_threshold(age) for age in AGES]
    assert thresholds == sorted(thresholds, reverse=True)
    assert contrast_threshold(3.0) == pytest.approx(1.0 / 13.0, rel=0.01)
    assert max(thresholds) == 0.25


@pytest.mark.parametrize("filtered", [ContrastThreshold(0.2), InfantVision(1.0)])
@pytest.mark.parametrize("axis", [1, 2])
def test_a_mirror_image_gives_the_mirror_image(filtered, axis):
    images = np.random.default_rng(0).integers(0, 256, (2, 84, 60, 3), np.uint8)
    mirrored = filtered(np.flip(images, axis).copy(), context_of())
    there = np.flip(filtered(images, context_of()), axis).astype(int)
    assert np.abs(mirrored - there).max() <= 1  # sums of single precision in another order
