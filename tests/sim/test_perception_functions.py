"""Perception on request: images of any camera, readings of taxels and the lines that show them."""

import numpy as np
import pytest
from touching import SPREAD, Stage
from walking import ball, empty_world, walker_in

from veca_marl.envs.rendering import draw_tactile_lines
from veca_marl.sim.touch import get_tactile, load_taxels, taxel_positions
from veca_marl.sim.touch.touch_sense import LINE_M
from veca_marl.sim.vision import Camera, EyeViews, get_image, look_at


def test_an_image_is_what_the_eye_sees_in_any_size_and_in_grey():
    world = empty_world(ball(colour=(0.9, 0.2, 0.1)))
    walker = walker_in(world)
    world.refresh()
    eye = walker.mount("eye_right")
    seen = EyeViews(world.scene, walker, Camera(40, 30), ["eye_right"]).views().rgb[0]
    image = get_image(world.scene, eye, 30, 40, owner=walker)
    np.testing.assert_array_equal(image, seen)
    grey = get_image(world.scene, eye, 30, 40, grayscale=True, owner=walker)
    luma = image @ np.array([0.299, 0.587, 0.114])
    assert np.abs(grey - luma).max() <= 1.0
    with pytest.raises(ValueError, match="0x30"):
        get_image(world.scene, eye, 30, 0)


@pytest.fixture(scope="module")
def pressed():
    stage = Stage(SPREAD)
    stage.add("SPHERE", (0.05,), stage.at("r_thigh", (0.085, 0.0, -0.08)))
    stage.scene.update()
    return stage


def test_all_taxels_are_read_and_a_share_of_them_can_be_disabled(pressed):
    everything = get_tactile(pressed.sense).readings
    np.testing.assert_array_equal(everything, pressed.sense.update_taxels().ravel())
    third = get_tactile(pressed.sense, taxel_ratio=1.0 / 3.0).readings
    np.testing.assert_array_equal(third[2::3], everything[2::3])
    assert np.count_nonzero(third) == np.count_nonzero(everything[2::3]) > 0
    assert not get_tactile(pressed.sense, taxel_ratio=0.0).readings.any()
    with pytest.raises(ValueError, match=r"taxel_ratio=1.5"):
        get_tactile(pressed.sense, taxel_ratio=1.5)


def test_a_line_starts_at_each_pressed_taxel_and_points_into_the_body(pressed):
    readings, lines = get_tactile(pressed.sense, debug=True)
    assert get_tactile(pressed.sense).lines.shape == (0, 2, 3)
    felt = np.flatnonzero(readings)
    assert lines.shape == (len(felt), 2, 3)
    taxels, normals = taxel_positions(load_taxels(), pressed.sense.skin_vertices())
    np.testing.assert_array_equal(lines[:, 0], taxels.reshape(-1, 3)[felt])
    way = lines[:, 1] - lines[:, 0]
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), LINE_M * readings[felt])
    assert ((way * normals[felt // 6]).sum(axis=1) < 0.0).all()


def test_lines_are_drawn_in_blue_where_the_camera_sees_them():
    camera, pose = Camera(60, 60), look_at(np.array([-1.0, 0.0, 0.0]), np.zeros(3))
    black = np.zeros((60, 60, 3), np.uint8)
    across = np.array([[[0.0, 0.2, 0.0], [0.0, -0.2, 0.0]]])
    drawn = draw_tactile_lines(black, camera, pose, across)
    rows, columns = np.nonzero(drawn.any(axis=2))
    assert set(rows) == {30}
    assert columns.min() < 22
    assert columns.max() > 38
    assert (drawn[30, 30] == (40, 90, 255)).all()
    assert not black.any()
    behind = across - np.array([2.0, 0.0, 0.0])
    assert not draw_tactile_lines(black, camera, pose, behind).any()
    with pytest.raises(ValueError, match="60"):
        draw_tactile_lines(black[:-1], camera, pose, across)
