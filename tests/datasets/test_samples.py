"""The samples of every data set: they depend only on the index, and their labels are right."""

import math
from functools import cache

import numpy as np
import pytest

from veca_marl.datasets.configuration import compose_dataset, make_dataset
from veca_marl.datasets.dataset import DATASETS, sample_generator
from veca_marl.datasets.kinds.images import box_of
from veca_marl.datasets.kinds.recordings import direction_in_head
from veca_marl.datasets.kinds.still_skin import as_bytes, binding_taxels
from veca_marl.datasets.kinds.toy_scenes import INTERPUPILLARY_M
from veca_marl.sim.body.sense_organs import MOUNTS_M

NAMES = sorted(DATASETS)


@cache
def dataset(name, *words):
    return make_dataset(compose_dataset([f"+dataset={name}", *words]))


def equal(one, other):
    return all(np.array_equal(one[key], other[key]) for key in {**one, **other})


@pytest.mark.parametrize("name", NAMES)
def test_a_sample_depends_on_its_index_and_not_on_those_before(name):
    first = dataset(name).sample(0, 7)
    dataset(name).sample(0, 3)
    assert equal(first, dataset(name).sample(0, 7))
    fresh = make_dataset(compose_dataset([f"+dataset={name}"]))
    assert equal(first, fresh.sample(0, 7))


@pytest.mark.parametrize("name", NAMES)
def test_other_indices_and_seeds_give_other_samples(name):
    first = dataset(name).sample(0, 0)
    assert not equal(first, dataset(name).sample(0, 1))
    assert not equal(first, dataset(name).sample(1, 0))


def test_generators_of_data_sets_seeds_and_indices_differ():
    triples = [("a", 0, 0), ("b", 0, 0), ("a", 1, 0), ("a", 0, 1), ("a", 1, 1)]
    assert len({sample_generator(*each).integers(2**63) for each in triples}) == len(triples)


@pytest.mark.parametrize("name", NAMES)
def test_every_data_set_has_an_input_a_label_and_a_preset_of_its_name(name):
    roles = {field.role.value for field in dataset(name).fields.values()}
    assert {"input", "label"} <= roles
    assert dataset(name).name == name


def test_the_box_encloses_the_pixels_exactly():
    shown = np.zeros((10, 20), bool)
    shown[2:5, 4:10] = True
    x, y, h, w = box_of(shown)
    assert (x, y, h, w) == pytest.approx((7 / 20, 3.5 / 10, 3 / 10, 6 / 20))


@pytest.mark.parametrize("index", range(4))
def test_disparities_are_those_of_the_depths(index):
    sample = dataset("depth_disparity").sample(2, index)
    focal_px = 42.0 / math.tan(math.radians(30.0))
    product = sample["disparity"] * sample["depth"]
    assert product == pytest.approx(focal_px * INTERPUPILLARY_M, rel=1e-4)
    assert MOUNTS_M["eye_left"][1] * 2.0 == pytest.approx(INTERPUPILLARY_M)


def test_the_right_image_is_the_left_one_shifted_by_the_disparity():
    """Summed over samples, the shift that matches best is the median disparity, not zero."""
    better = 0
    for index in range(8):
        sample = dataset("depth_disparity").sample(5, index)
        left, right = sample["vision"].astype(float)
        shift = round(float(np.median(sample["disparity"])))
        if shift == 0:
            continue
        shifted = np.abs(left[..., shift:] - right[..., :-shift]).mean()
        better += shifted < np.abs(left - right).mean()
    assert better >= 4


def test_the_eyes_of_a_monocular_set_are_alike():
    sample = dataset("distance_estimation", "senses/vision=monocular").sample(0, 0)
    assert np.array_equal(*sample["vision"])
    other = dataset("distance_estimation").sample(0, 0)
    assert not np.array_equal(*other["vision"])


@pytest.mark.parametrize("quality", ["grey", "blur", "infant"])
def test_the_quality_of_vision_changes_images_and_neither_shapes_nor_labels(quality):
    """Pixel counts decide which scene is taken, and they are those before the filters."""
    plain = dataset("object_classification").sample(0, 1)
    changed = dataset("object_classification", f"senses/vision={quality}").sample(0, 1)
    assert changed["image"].shape == plain["image"].shape
    assert not np.array_equal(changed["image"], plain["image"])
    assert changed["kind"] == plain["kind"]


def test_the_nearer_ear_hears_more_energy():
    lateral = agreeing = 0
    for index in range(40):
        sample = dataset("sound_localisation").sample(3, index)
        if abs(sample["direction"][1]) > 0.7:
            left, right = (sample["waveform"].astype(float) ** 2).mean(axis=1)
            lateral += 1
            agreeing += (left > right) == (sample["direction"][1] > 0.0)
    assert lateral >= 5
    assert agreeing >= 0.8 * lateral


def test_qualities_of_hearing_share_scenes_and_differ_in_sound():
    samples = {
        quality: dataset("sound_localisation", f"senses/audio={quality}").sample(0, 0)
        for quality in ("hrtf", "stereo", "mono")
    }
    assert np.array_equal(*samples["mono"]["waveform"])
    assert not np.array_equal(*samples["stereo"]["waveform"])
    for quality in ("stereo", "mono"):
        assert np.array_equal(samples[quality]["direction"], samples["hrtf"]["direction"])


def test_directions_are_in_the_frame_of_the_head():
    to_the_left = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert direction_in_head(to_the_left, [0.0, 2.0, 0.0]) == pytest.approx([1.0, 0.0, 0.0])
    assert direction_in_head(to_the_left, [-1.0, 0.0, 0.0]) == pytest.approx([0.0, 1.0, 0.0])


def test_the_azimuth_of_the_sounding_toy_is_that_of_the_louder_ear():
    lateral = agreeing = 0
    for index in range(30):
        sample = dataset("audiovisual_correspondence").sample(0, index)
        azimuth = sample["azimuths"][int(sample["sounding"])]
        if abs(azimuth) > 12.0:
            left, right = (sample["waveform"].astype(float) ** 2).mean(axis=1)
            lateral += 1
            agreeing += (left > right) == (azimuth > 0.0)
    assert lateral >= 5
    assert agreeing >= 0.8 * lateral


@pytest.mark.parametrize("index", range(5))
def test_the_touched_taxel_feels_the_ball(index):
    sample = dataset("contact_localisation").sample(1, index)
    taxel = int(sample["taxel"])
    assert sample["touch"][taxel] > 0
    place = binding_taxels().reshape(-1, 3)[taxel]
    assert sample["position"] == pytest.approx(place, abs=1e-6)


def test_a_binary_skin_reads_all_or_nothing_at_the_same_taxels():
    graded = dataset("contact_localisation").sample(0, 0)["touch"]
    binary = dataset("contact_localisation", "senses/touch=binary").sample(0, 0)["touch"]
    assert set(np.unique(binary)) <= {0, 255}
    assert np.array_equal(binary > 0, graded > 0)


def test_parts_of_the_hand_are_means_and_maxima_of_its_taxels():
    parts = dataset("tactile_classification", "senses/touch=parts_only").sample(0, 0)
    taxels = dataset("tactile_classification").sample(0, 0)["touch"]
    field = dataset("tactile_classification", "senses/touch=parts_only").fields["touch_parts"]
    assert parts["touch_parts"].shape == (128, len(field.names)) == (128, 24)
    assert all(name.startswith("r_") for name in field.names)
    assert np.array_equal(parts["touch_parts"][:, 12:].max(axis=1), taxels.max(axis=1))


@pytest.mark.parametrize("index", range(3))
def test_a_toy_falls_before_it_is_felt_and_stays_on_the_hand_for_a_while(index):
    touch = dataset("tactile_classification").sample(4, index)["touch"]
    felt = touch.any(axis=1)
    assert not felt[0]
    assert felt.sum() >= 40


def test_faint_readings_are_not_lost():
    assert as_bytes(np.array([0.0, 1e-6, 0.5, 1.0])).tolist() == [0, 1, 128, 255]
