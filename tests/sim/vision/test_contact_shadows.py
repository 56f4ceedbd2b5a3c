"""Contact shadows: primitives darken the floor near them, and only there."""

import numpy as np

from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera
from veca_marl.sim.vision.contact_shadows import DARKNESS, LARGEST_M, REACH_M

DOWN = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]])
LOW_BOX = Shape.BOX, (0.1, 0.1, 0.02)


def floor_brightness(bottom_m=None, shape=Shape.SPHERE, size=(0.2,), tangible=True):
    """Red channel of the floor from above, beside and around a primitive at some height."""
    scene = Scene()
    scene.add_object(
        "floor", [[Geom(Shape.BOX, (9, 9, 0.5), colour=(1, 1, 1), offset=(0, 0, -0.5))]]
    )
    if bottom_m is not None:
        half = size[0] if shape is Shape.SPHERE else size[2]
        thing = scene.add_object("thing", [[Geom(shape, size, tangible=tangible)]])
        thing.positions[0] = (0, 0, bottom_m + half)
    scene.update()
    views = Camera(200, 200).render(scene, [Pose(np.array([0, 0, 2.0]), DOWN)])
    return np.where(views.ids[0] == 0, views.rgb[0, ..., 0].astype(float), np.nan)


def test_a_standing_primitive_darkens_the_floor_around_it():
    bare, shaded = floor_brightness(), floor_brightness(0.0, *LOW_BOX)
    ratio = shaded / bare
    assert np.nanmin(ratio) < 0.75
    assert np.nanmin(ratio) >= 1.0 - DARKNESS - 0.01
    seen = np.isfinite(ratio)
    np.testing.assert_allclose(ratio[seen], ratio[::-1, ::-1][seen], atol=0.02)
    assert ratio[0, 0] == 1.0


def test_a_primitive_beyond_the_reach_casts_no_shadow():
    bare = floor_brightness()
    darkest = [
        np.nanmin(floor_brightness(height_m, *LOW_BOX) / bare)
        for height_m in (0.0, 0.5 * REACH_M, 1.01 * REACH_M)
    ]
    assert darkest == sorted(darkest)
    assert darkest[0] < darkest[1] < darkest[2] == 1.0


def test_what_is_only_seen_casts_no_contact_shadow():
    """Such as the mark of a place on the floor."""
    marked = floor_brightness(0.0, *LOW_BOX, tangible=False)
    assert np.nanmin(marked / floor_brightness()) == 1.0


def test_a_primitive_larger_than_the_limit_casts_no_shadow():
    wide = (LARGEST_M, 0.1, 0.1)
    assert np.nanmin(floor_brightness(0.0, Shape.BOX, wide) / floor_brightness()) == 1.0


def test_a_primitive_does_not_darken_itself():
    """A sheet in the plane of the floor has the colour of one above it."""
    colours = []
    for height_m in (0.002, 1.0):
        scene = Scene()
        sheet = scene.add_object("sheet", [[Geom(Shape.BOX, (0.5, 0.5, 0.002))]])
        sheet.positions[0] = (0, 0, height_m)
        scene.update()
        views = Camera().render(scene, [Pose(np.array([0, 0, 2.0]), DOWN)])
        colours.append(views.rgb[0, 42, 42])
    np.testing.assert_array_equal(*colours)


def test_things_side_by_side_darken_the_floor_no_more_than_one():
    """The bones of a hand are one dark thing, not nineteen shadows over each other."""
    darkest = []
    for count in (0, 1, 12):
        scene = Scene()
        ground = Geom(Shape.BOX, (9, 9, 0.5), colour=(1, 1, 1), offset=(0, 0, -0.5))
        scene.add_object("floor", [[ground]])
        for finger in range(count):
            rod = Geom(Shape.CAPSULE, (0.01, 0.2), offset=(0.005 * finger, 0, 0.1))
            scene.add_object(f"finger {finger}", [[rod]])
        scene.update()
        views = Camera(200, 200).render(scene, [Pose(np.array([0, 0, 2.0]), DOWN)])
        shown = views.rgb[0, ..., 0].astype(float)
        darkest.append(shown[views.ids[0] == 0].min())
    bare, one, many = darkest
    assert bare > one
    assert many >= one - 1.0
