"""Named parts of the skin: a symmetric partition of the triangles, their means and maxima."""

import numpy as np
import pytest
from composed import compose
from touching import SPREAD, Stage

from veca_marl.sim.sense import check_spec
from veca_marl.sim.touch import TouchCfg, TouchQuality, skin_parts, taxels_of


def parts_by_name():
    return {part.name: part for part in skin_parts()}


def read_parts(cfg, *touched):
    """Means and maxima by name, and the taxels, of a body touched by balls."""
    stage = Stage(SPREAD, cfg)
    for bone, point in touched:
        stage.add("SPHERE", (0.02,), stage.at(bone, point))
    stage.scene.update()
    observed = stage.sense.read()
    for key, spec in stage.sense.specs.items():
        check_spec(key, observed[key], spec)
    means, maxima = np.split(observed["touch_parts"], 2)
    names = [part.name for part in skin_parts()]
    return dict(zip(names, zip(means, maxima, strict=True), strict=True)), observed


def test_each_triangle_is_in_one_of_the_59_parts():
    triangles = np.concatenate([part.triangles for part in skin_parts()])
    np.testing.assert_array_equal(np.sort(triangles), np.arange(1648))
    assert len(parts_by_name()) == 59
    assert min(len(part.triangles) for part in skin_parts()) >= 6


def test_left_and_right_parts_have_the_same_triangles():
    """The triangles of mirrored bones have the same order."""
    parts = parts_by_name()
    for name, part in parts.items():
        if not name.startswith("l_"):
            continue
        mirrored = parts[f"r_{name[2:]}"]
        bones = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
        shift = taxels_of("r_upper_arm").start - taxels_of("l_upper_arm").start
        if any(bone in name for bone in bones) or "heel" in name:
            np.testing.assert_array_equal(part.taxels + shift, mirrored.taxels)
        assert len(part.triangles) == len(mirrored.triangles)
    assert len(parts["head_left"].triangles) == len(parts["head_right"].triangles)


def test_mean_and_maximum_are_those_of_the_taxels_of_a_part():
    felt, observed = read_parts(TouchCfg(parts=True), ("l_hand", (0.0, -0.025, -0.03)))
    for part in skin_parts():
        taxels = observed["touch"][part.taxels]
        assert felt[part.name] == pytest.approx((taxels.mean(), taxels.max()), rel=1e-5)
    assert felt["l_palm"][1] > 0.1
    assert felt["l_hand_back"][1] == 0.0
    assert felt["r_palm"] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("bone", "point", "name"),
    [
        ("r_hand", (0.0, 0.025, -0.03), "r_palm"),
        ("l_hand", (0.0, 0.025, -0.03), "l_hand_back"),
        ("r_thigh", (0.055, 0.0, -0.08), "r_thigh_front"),
        ("l_foot", (0.062, 0.0, -0.06), "l_sole_front"),
        ("l_foot", (-0.01, 0.0, -0.058), "l_heel"),
        ("head", (0.1, 0.0, 0.066), "head_front"),
        ("head", (0.01, 0.08, 0.066), "head_left"),
        ("l_index_distal", (0.012, 0.0, -0.02), "l_index_tip"),
    ],
)
def test_contact_is_sensed_by_the_part_at_the_place(bone, point, name):
    felt, _ = read_parts(TouchCfg(parts=True), (bone, point))
    assert max(felt, key=lambda part: felt[part][1]) == name


def test_parts_are_computed_from_what_the_quality_leaves():
    hands = TouchCfg(parts=True, quality=TouchQuality.hands)
    felt, _ = read_parts(hands, ("r_thigh", (0.055, 0.0, -0.08)), ("r_hand", (0.0, 0.025, -0.03)))
    assert felt["r_thigh_front"] == (0.0, 0.0)
    assert felt["r_palm"][1] > 0.0


@pytest.mark.parametrize(
    ("preset", "keys"),
    [("skin", {"touch"}), ("parts", {"touch", "touch_parts"}), ("parts_only", {"touch_parts"})],
)
def test_a_preset_determines_the_keys(preset, keys):
    cfg = compose(["+task=TurnBaby", f"senses/touch={preset}"]).senses.touch
    assert set(Stage(SPREAD, cfg).sense.specs) == keys


def test_touch_without_taxels_and_parts_is_refused():
    with pytest.raises(ValueError, match=r"senses.touch.present=false"):
        TouchCfg(taxels=False)
    assert not TouchCfg(present=False, taxels=False).parts
