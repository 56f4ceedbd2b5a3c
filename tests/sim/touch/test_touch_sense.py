"""The sense of touch: its qualities, presets and configuration errors."""

import numpy as np
import pytest
from composed import compose
from refusals import naming
from stand_in_worlds import SceneWorld
from touching import SPREAD, Named, Stage, of_bone

from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.geometry import Geom, Scene, Shape
from veca_marl.sim.physics import PlaygroundCfg, World
from veca_marl.sim.sense import check_spec
from veca_marl.sim.senses import SensesCfg, make_senses
from veca_marl.sim.touch import TouchCfg, TouchQuality, TouchSense


def touched(cfg):
    """The sense and the observation of a body touched on a hand, a finger and a thigh."""
    stage = Stage(SPREAD, cfg)
    stage.add("SPHERE", (0.02,), stage.at("l_hand", (0.0, 0.025, -0.03)))
    stage.add("SPHERE", (0.02,), stage.at("l_index_proximal", (0.0, 0.023, -0.008)))
    stage.add("SPHERE", (0.05,), stage.at("r_thigh", (0.085, 0.0, -0.08)))
    stage.scene.update()
    observed = stage.sense.read()["touch"]
    return stage.sense, observed, observed.reshape(-1, 6)


@pytest.mark.parametrize("quality", list(TouchQuality))
def test_quality_changes_the_content_but_not_the_spec(quality):
    sense, observed, _ = touched(TouchCfg(quality=quality))
    assert sense.specs == touched(TouchCfg())[0].specs
    assert sense.specs["touch"].shape == (9888,)
    check_spec("touch", observed, sense.specs["touch"])
    assert 0.0 < observed.max() <= 1.0
    assert observed.min() == 0.0


def test_hands_keeps_hands_and_fingers_only():
    _, _, everywhere = touched(TouchCfg())
    _, _, hands = touched(TouchCfg(quality=TouchQuality.hands))
    for bone in ("l_hand", "l_index_proximal"):
        assert of_bone(hands, bone).any()
        np.testing.assert_array_equal(of_bone(hands, bone), of_bone(everywhere, bone))
    assert of_bone(everywhere, "r_thigh").any()
    assert not of_bone(hands, "r_thigh").any()


def test_binary_touch_says_where_and_not_how_much():
    _, fine, _ = touched(TouchCfg())
    _, all_or_none, _ = touched(TouchCfg(quality=TouchQuality.binary))
    np.testing.assert_array_equal(all_or_none, fine > 0.0)
    _, firm, _ = touched(TouchCfg(quality=TouchQuality.binary, binary_above=0.3))
    np.testing.assert_array_equal(firm, fine > 0.3)
    assert 0 < firm.sum() < all_or_none.sum()


def test_coarse_touch_is_the_mean_of_each_bone():
    _, _, fine = touched(TouchCfg())
    _, _, coarse = touched(TouchCfg(quality=TouchQuality.coarse))
    for bone in ("l_hand", "r_thigh", "head"):
        assert np.unique(of_bone(coarse, bone)).size == 1
        assert of_bone(coarse, bone)[0, 0] == pytest.approx(of_bone(fine, bone).mean(), rel=1e-5)


@pytest.mark.parametrize(
    ("name", "quality"),
    [("skin", "skin"), ("hands", "hands"), ("binary", "binary"), ("coarse", "coarse")],
)
def test_every_preset_selects_its_quality(name, quality):
    touch = compose(["+task=KickTheBall", f"senses/touch={name}"]).senses.touch
    assert touch.present
    assert touch.quality is TouchQuality[quality]


def test_the_preset_numb_leaves_touch_out():
    senses = compose(["+task=KickTheBall", "senses/touch=numb"]).senses
    world = World(PlaygroundCfg())
    walker = Walker("walker", WalkerCfg(), world)
    assert set(make_senses(walker, ["audio", "touch"], senses, world)) == {"audio"}
    assert set(make_senses(walker, ["touch"], SensesCfg(), world)) == {"touch"}
    world.close()


def test_a_standing_walker_has_contact_at_its_soles():
    world = World(PlaygroundCfg())
    walker = Walker("walker", WalkerCfg(), world)
    sense = TouchSense(TouchCfg(), walker, world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    world.refresh()
    readings = sense.update_taxels()
    for foot in ("l_foot", "r_foot"):
        assert of_bone(readings, foot).max() > 0.9  # the weight rests on the bones
    assert not of_bone(readings, "head").any()
    world.close()


def test_a_body_without_skin_is_refused():
    scene = Scene()
    ball = scene.add_object("ball", [[Geom(Shape.SPHERE, (0.1,))]])
    with pytest.raises(ValueError, match=naming("ball", "skin")):
        TouchSense(TouchCfg(), Named("ball", ball.id), SceneWorld(scene))


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"quality": "rough"}, ("quality='rough'", "skin", "hands")),
        ({"binary_above": 1.0}, ("binary_above=1.0",)),
    ],
)
def test_invalid_settings_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        TouchCfg(**numbers)
