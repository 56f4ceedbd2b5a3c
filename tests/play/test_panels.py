"""Panels: images of what an agent senses and of its rewards."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.rendering.panels import (
    GAIN,
    LOSS,
    TermBar,
    eye_panels,
    reward_bars,
    skin_panel,
    spectrograms,
)
from veca_marl.sim.touch import taxels_of
from veca_marl.sim.touch.parts import skin_parts


def brightness(image):
    return image.astype(int).sum(axis=2)


def test_each_eye_has_its_image_enlarged():
    vision = np.zeros((2, 3, 84, 84), np.uint8)
    vision[0, 0], vision[1, 2] = 200, 100
    left, right = eye_panels({"vision": vision}, 320)
    assert left.shape == right.shape == (320, 320, 3)
    assert tuple(left[200, 200]) == (200, 0, 0)
    assert tuple(right[200, 200]) == (0, 0, 100)


def test_images_keep_their_ratio():
    left, _ = eye_panels({"vision": np.full((2, 3, 42, 84), 255, np.uint8)}, 320)
    assert left.shape == (160, 320, 3)
    assert left[100, 160].tolist() == [255, 255, 255]


def test_a_tone_is_a_bright_row_in_the_last_column():
    """A low tone at the left ear is low in its panel, and only in the present step."""
    before, now = np.full((2, 2, 250), -8.0)
    now[0, 25] = 2.0
    left, right = spectrograms([before, now], columns=25, height=250, width=250)
    row, column = np.unravel_index(brightness(left)[30:].argmax(), (220, 250))
    assert row + 30 == 250 - 1 - 25
    assert column >= 240
    assert brightness(right)[30:].max() < 100


def test_what_is_not_sensed_has_no_panel(game):
    assert eye_panels({}, 320) == []
    assert spectrograms([], 25, 160, 320) == []
    scene = game.world.scene
    body = scene.objects[game.actors[0].body.object_id]
    assert skin_panel(scene, body, {}, 240) is None


def test_a_bar_grows_to_the_right_for_a_gain_and_to_the_left_for_a_loss():
    image = reward_bars(
        [TermBar("kick", 0.5, 1.0, 1.0), TermBar("effort", -1.0, -2.0, 1.0)], 240, 480
    )
    gain, loss = (np.argwhere((image == colour).all(axis=2))[:, 1] for colour in (GAIN, LOSS))
    assert gain.min() > loss.max()
    assert np.ptp(loss) == pytest.approx(2 * np.ptp(gain), abs=4)


@pytest.fixture(scope="module")
def game():
    game = Game(compose(["+task=KickTheBall"]).game)
    game.reset(np.random.default_rng(0))
    yield game
    game.close()


def test_touched_skin_is_coloured(game):
    scene = game.world.scene
    body = scene.objects[game.actors[0].body.object_id]
    touch = np.zeros(9888, np.float32)
    pale = skin_panel(scene, body, {"touch": touch}, 240)
    touch[taxels_of("chest")] = 1.0
    touched = skin_panel(scene, body, {"touch": touch}, 240)
    assert pale.shape == touched.shape == (240, 320, 3)
    assert (touched[30:] != pale[30:]).any(axis=2).sum() > 100
    parts = np.zeros(2 * len(skin_parts()), np.float32)
    chest = [p for p, part in enumerate(skin_parts()) if part.name.startswith("chest")]
    parts[len(skin_parts()) :][chest] = 1.0
    by_parts = skin_panel(scene, body, {"touch_parts": parts}, 240)
    np.testing.assert_array_equal(by_parts[30:], touched[30:])
