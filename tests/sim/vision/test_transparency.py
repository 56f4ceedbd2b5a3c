"""Transparent layers: any number of them, in any order, and the light that they let through."""

import numpy as np
import pytest
from eye_scenes import random_pose, random_rotations, random_size, small_camera

from veca_marl.sim.geometry import Geom, Pose, Scene, Shape
from veca_marl.sim.vision import Camera, seen_fraction
from veca_marl.sim.vision.shading import GLASS_OPACITY

AHEAD = Pose(np.zeros(3), np.eye(3))


def glass(shape, size, colour=(0.2, 0.4, 0.9)):
    return Geom(shape, size, colour=colour, transparent=True)


def panes(count, behind=None):
    """Panes at 1 m, 1.1 m and so on, and a thing at 3 m; ids in the order of their distance."""
    scene = Scene()
    for number in range(count):
        pane = scene.add_object(f"pane {number}", [[glass(Shape.BOX, (0.01, 2, 2))]])
        pane.positions[0] = (1.0 + 0.1 * number, 0, 0)
    if behind is not None:
        scene.add_object("thing", [[behind]]).positions[0] = (3, 0, 0)
    scene.update()
    return scene


@pytest.mark.parametrize("count", [0, 1, 2, 5, 12])
def test_a_cup_behind_any_number_of_panes_is_visible(count):
    cup = glass(Shape.CYLINDER, (0.2, 0.4), (1.0, 0.0, 0.0))
    scene = panes(count, cup)
    views = Camera().render(scene, [AHEAD])
    assert seen_fraction(views, count) == pytest.approx(0.0134, rel=0.15)
    assert views.glass_ids[:, 0, 42, 42].tolist() == list(range(count + 1))
    without = Camera().render(scene, [AHEAD], scene.hidden(count, (0,)))
    changed = (views.rgb != without.rgb).any(axis=-1)
    expected = (views.glass_ids == count).any(axis=0)
    if count <= 5:  # behind twelve panes of opacity 0.3 it changes the picture by 0.4 %
        np.testing.assert_array_equal(changed, expected)


@pytest.mark.parametrize("count", [1, 3, 6])
def test_light_is_attenuated_by_each_layer(count):
    """The share ``(1 - opacity)^n`` of the colour behind n panes, within rounding to bytes."""
    white = Geom(Shape.BOX, (0.1, 1, 1), colour=(1, 1, 1))
    black = Geom(Shape.BOX, (0.1, 1, 1), colour=(0, 0, 0))
    bright, dark, bare = (
        Camera().render(panes(n, thing), [AHEAD]).rgb[0, 42, 42].astype(float)
        for n, thing in ((count, white), (count, black), (0, white))
    )
    np.testing.assert_allclose(bright - dark, bare * (1.0 - GLASS_OPACITY) ** count, atol=1.5)


def overlapping_things(rng, order):
    """Opaque and transparent primitives of all shapes that overlap, added in some order."""
    things = []
    for number in range(14):
        shape = Shape(number % 4)
        colour = tuple(rng.uniform(size=3))
        geom = Geom(shape, random_size(shape, rng), colour=colour, transparent=number >= 4)
        things.append((geom, rng.uniform((-1, -1, 0), (1, 1, 1)), random_rotations(1, rng)[0]))
    scene = Scene()
    for number in order:
        geom, position, rotation = things[number]
        item = scene.add_object(f"thing {number}", [[geom]])
        item.positions[0], item.rotations[0] = position, rotation
    scene.update()
    return scene


def pose_through(layers, scene, rng):
    """A random pose from which so many transparent layers cover a pixel."""
    for _ in range(200):
        pose = random_pose(rng)
        if len(small_camera().render(scene, [pose]).glass_ids) >= layers:
            return pose
    raise AssertionError(f"no pose with {layers} layers")


@pytest.mark.parametrize("seed", range(3))
def test_the_picture_does_not_depend_on_the_order_of_objects(seed):
    orders = [np.arange(14), np.random.default_rng(seed).permutation(14)]
    scenes = [overlapping_things(np.random.default_rng(100 + seed), order) for order in orders]
    rng = np.random.default_rng(seed)
    poses = [pose_through(2, scenes[0], rng), random_pose(rng), random_pose(rng)]
    one, other = (small_camera().render(scene, poses) for scene in scenes)
    assert len(one.glass_ids) == len(other.glass_ids) >= 2
    np.testing.assert_array_equal(one.rgb, other.rgb)
    names = [np.array([item.name for item in scene.objects] + ["none"]) for scene in scenes]
    np.testing.assert_array_equal(names[0][one.glass_ids], names[1][other.glass_ids])


def test_layers_are_those_of_each_object_alone():
    """Each transparent object is seen where it is seen when the others are absent."""
    scene = overlapping_things(np.random.default_rng(7), range(14))
    pose = pose_through(3, scene, np.random.default_rng(1))
    together = small_camera().render(scene, [pose])
    for item in scene.objects[4:]:
        others = np.isin(scene.surfaces.objects, [o.id for o in scene.objects[4:] if o is not item])
        alone = small_camera().render(scene, [pose], others)
        assert (alone.glass_ids == item.id).sum() == (together.glass_ids == item.id).sum()


def test_views_of_one_call_may_have_different_numbers_of_layers():
    scene = panes(3)
    back = Pose(np.zeros(3), np.diag([-1.0, -1.0, 1.0]))
    views = Camera().render(scene, [AHEAD, back])
    assert views.glass_ids.shape == (3, 2, 84, 84)
    assert (views.glass_ids[:, 1] == -1).all()
    np.testing.assert_array_equal(views.rgb[1], Camera().render(scene, [back]).rgb[0])
