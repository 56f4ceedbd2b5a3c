"""Video frames of a game."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.rendering import FRAME_HEIGHT, ROOM_WIDTH, Spectator, eye_images
from veca_marl.sim.touch import taxels_of


@pytest.fixture
def game():
    game = Game(compose(["+task=KickTheBall"]).game)
    game.reset(np.random.default_rng(0))
    yield game
    game.close()


def walk(game, steps, watch=lambda observation: None):
    """Play some steps; return all observations."""
    seen = []
    for _ in range(steps):
        game.step({"agents": np.array([1.0, 0.2], np.float32)})
        observation = game.observe(game.players[0])
        watch(observation)
        seen += [array.tobytes() for array in observation.values()]
    return seen


def test_a_frame_shows_both_eyes_and_the_room(game):
    frame = Spectator(game).frame(game.observe(game.players[0]))
    assert frame.shape == (FRAME_HEIGHT, 2 * FRAME_HEIGHT + ROOM_WIDTH, 3)
    assert frame.dtype == np.uint8
    assert frame.shape[1] % 2 == 0  # video codecs want it


def test_with_touch_the_frame_shows_the_skin(game):
    spectator, touch = Spectator(game), np.zeros(9888, np.float32)
    pale = spectator.frame({"touch": touch})
    assert pale.shape == (FRAME_HEIGHT, pale.shape[1], 3)
    assert pale.shape[1] > ROOM_WIDTH
    assert pale.shape[1] % 2 == 0
    touch[taxels_of("chest")] = 1.0
    touched = spectator.frame({"touch": touch})
    assert (touched[..., 0].astype(int) - pale[..., 0] != 0).sum() > 100
    np.testing.assert_array_equal(touched[:, -ROOM_WIDTH:], pale[:, -ROOM_WIDTH:])


def test_without_vision_the_frame_shows_the_room_only(game):
    spectator = Spectator(game)
    np.testing.assert_array_equal(spectator.frame({}), spectator.room())


def test_rendering_frames_does_not_change_the_game():
    films = []
    for watch in (False, True):
        game = Game(compose(["+task=KickTheBall"]).game)
        game.reset(np.random.default_rng(0))
        game.observe(game.players[0])
        films.append(walk(game, 5, Spectator(game).frame if watch else lambda observation: None))
        game.close()
    assert films[0] == films[1]


def test_the_room_shows_the_player(game):
    """The image differs without the body of the player."""
    spectator = Spectator(game)
    before = spectator.room().astype(int)
    player = game.players[0].body
    player._drawn.positions[:] += (0.0, 0.0, -5.0)
    player._drawn.positions[0, 2] += 5.0  # the camera turns to the pelvis
    game.world.scene.update()
    assert (np.abs(spectator.room() - before).max(axis=-1) > 30).sum() > 100


def test_eye_images_are_enlarged_without_interpolation():
    vision = np.arange(2 * 3 * 4 * 4, dtype=np.uint8).reshape(2, 3, 4, 4)
    left, _ = eye_images(vision)
    assert left.shape == (FRAME_HEIGHT, FRAME_HEIGHT, 3)
    block = FRAME_HEIGHT // 4
    for row in range(4):
        for column in range(4):
            square = left[row * block : (row + 1) * block, column * block : (column + 1) * block]
            assert (square == vision[0, :, row, column]).all()
