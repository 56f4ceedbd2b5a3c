"""Soft shadows of pictures for people."""

import numpy as np
import pytest

from veca_marl.envs.rendering import Quality, photograph
from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera
from veca_marl.sim.vision.shading import AMBIENT, SUN

DOWN = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]])
AWAY_M = 4.0


def floor(heights_m, half_m=(0.3, 0.3, 0.02), soft=True):
    """Return the red channel of a white floor from above, NaN where a plate hides it."""
    scene = Scene()
    ground = Geom(Shape.BOX, (9, 9, 0.5), colour=(0.7, 0.7, 0.7), offset=(0, 0, -0.5))
    scene.add_object("floor", [[ground]])
    for height_m in heights_m:
        plate = scene.add_object(f"plate {height_m}", [[Geom(Shape.BOX, half_m)]])
        plate.positions[0] = (0, 0, height_m)
    scene.update()
    camera, pose = Camera(200, 200), Pose(np.array([0, 0, AWAY_M]), DOWN)
    ids = camera.render(scene, [pose]).ids[0]
    red = photograph(scene, camera, pose, Quality(soft, supersampling=1))[..., 0]
    return np.where(ids == 0, red.astype(float), np.nan)


def test_an_empty_floor_has_no_shadow():
    assert np.ptp(floor([])) <= 1.0


@pytest.mark.parametrize("height_m", [0.3, 0.8])
def test_the_shadow_is_where_the_sun_throws_it(height_m):
    red, bare = floor([height_m]), floor([])
    dark = np.argwhere(red < bare - 25.0)
    assert len(dark) > 100
    # the centre of the shadow: away from the sun, by its slope times the height
    expected = -height_m * np.array(SUN[:2]) / SUN[2]
    per_m = 100.0 / (AWAY_M * np.tan(np.radians(30.0)))
    # rows run along -x of the world and columns along -y, as the camera looks down with x upwards
    seen = np.stack([-(dark[:, 0] - 99.5), -(dark[:, 1] - 99.5)], axis=1) / per_m
    low, high = expected - 0.3, expected + 0.3
    inside = ((seen > low - 0.1) & (seen < high + 0.1)).all(axis=1)
    assert inside.mean() > 0.95


def test_a_shadow_keeps_the_ambient_light():
    red, bare = floor([0.8]), floor([])
    assert np.nanmin(red) > AMBIENT * np.nanmin(bare)


def test_shadows_are_softer_far_from_what_casts_them():
    """The number of pixels between light and dark grows with the height."""
    widths = []
    for height_m in (0.15, 1.2):
        red, bare = floor([height_m], (0.6, 0.6, 0.02)), floor([])
        ratio = red / bare
        seen = np.isfinite(ratio)
        dark = np.nanmin(ratio)
        between = (ratio > dark + 0.05) & (ratio < 0.97) & seen
        full = (ratio < dark + 0.05) & seen
        widths.append(between.sum() / max(np.sqrt(full.sum()), 1.0))
    assert widths[1] > 1.5 * widths[0]


def test_walls_cast_no_shadow():
    """So that no agent acts in the dark."""
    red, bare = floor([0.5], (2.0, 0.05, 0.5)), floor([])
    seen = np.isfinite(red)
    far = seen & (np.abs(np.arange(200) - 99.5) > 15)[None]  # beside the contact shadow
    np.testing.assert_allclose(red[far], bare[far], atol=2.0)


def test_without_soft_shadows_a_plate_in_the_air_darkens_nothing():
    red, bare = floor([0.8], soft=False), floor([], soft=False)
    seen = np.isfinite(red)
    np.testing.assert_array_equal(red[seen], bare[seen])


def test_a_ball_casts_no_shadow_on_its_lit_side():
    scene = Scene()
    ball = scene.add_object("ball", [[Geom(Shape.SPHERE, (0.5,))]])
    ball.positions[0] = (0, 0, 1)
    scene.update()
    camera, pose = Camera(160, 160), Pose(np.array([0, 0, 3.0]), DOWN)
    soft, hard = (
        photograph(scene, camera, pose, Quality(shadows, supersampling=1)).astype(int)
        for shadows in (True, False)
    )
    ids = camera.render(scene, [pose]).ids[0]
    change = np.abs(soft - hard).max(axis=-1)[ids == 0]
    assert (change <= 3).mean() > 0.97


def test_quality_is_checked():
    for wrong in ({"supersampling": 0}, {"supersampling": 5}, {"map_px": 1}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            Quality(**wrong)
