"""The image of the touch readings."""

import cv2
import numpy as np
import pytest
from refusals import naming
from touching import Stage, of_bone

from veca_marl.envs.rendering import save_touch_image, touch_image


def red(picture):
    """Pixels in a colour of the scale, unlike body and background."""
    r, _, b = np.moveaxis(picture.astype(int), -1, 0)
    return r - b > 60


def test_contacts_are_coloured_in_the_view_that_shows_them():
    stage = Stage()
    untouched = touch_image(stage.scene, stage.body, stage.read())
    assert untouched.shape == (252, 336, 3)
    assert not red(untouched).any()
    stage.add("SPHERE", (0.06,), stage.at("chest", (0.1, 0.0, 0.09)))
    readings = stage.read()
    assert of_bone(readings, "chest").any()
    front, back = np.split(red(touch_image(stage.scene, stage.body, readings)), 2, axis=1)
    assert front.sum() > 20
    assert not back.any()


def test_a_larger_reading_has_another_colour():
    readings = np.zeros((1648, 6))
    stage = Stage()
    stage.read()
    colours = []
    for value in (0.1, 0.5, 1.0):
        readings[:] = value
        picture = touch_image(stage.scene, stage.body, readings)
        colours.append(picture[red(picture)].mean(axis=0))
    green = [colour[1] for colour in colours]
    assert green[0] > green[1] > green[2]


def test_the_saved_file_contains_the_image(tmp_path):
    stage = Stage()
    readings = stage.read()
    save_touch_image(tmp_path / "touch.png", stage.scene, stage.body, readings, height=120)
    saved = cv2.imread(str(tmp_path / "touch.png"))[..., ::-1]
    np.testing.assert_array_equal(saved, touch_image(stage.scene, stage.body, readings, 120))


def test_readings_of_another_shape_are_refused():
    stage = Stage()
    stage.scene.update()
    with pytest.raises(ValueError, match=naming("(9888,)", "(1648, 6)")):
        touch_image(stage.scene, stage.body, np.zeros(9888))
