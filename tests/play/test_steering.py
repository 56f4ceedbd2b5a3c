"""Keys as commands of a walking body, and samples as the loudspeaker plays them."""

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.play.steering import Keyboard, gaze_point, steering_help
from veca_marl.sim.physics.interactions import NO_VERB
from veca_marl.sim.sound import Call


@pytest.fixture(scope="module")
def walker():
    game = Game(compose(["+task=KickTheBall", "body=walker_verbs"]).game)
    game.reset(np.random.default_rng(0))
    yield game.actors[0].body
    game.close()


def test_movement_lasts_while_keys_are_held(walker):
    keys = Keyboard()
    keys.press("up")
    keys.press("d")
    assert keys.command(walker)[:2] == (1.0, -1.0)
    assert keys.command(walker)[:2] == (1.0, -1.0)
    keys.release("up")
    keys.press("s")
    keys.press("a")  # against d
    assert keys.command(walker)[:2] == (-1.0, 0.0)
    keys.release_all()
    assert keys.command(walker)[:2] == (0.0, 0.0)


def test_verbs_and_calls_are_chosen_once(walker):
    keys = Keyboard()
    keys.press("2")
    keys.press("c")
    command = keys.command(walker)
    assert command.verb == walker.cfg.verbs[1]
    assert command.call is Call.rising
    assert keys.command(walker)[2:] == (Call.none, NO_VERB)


def test_the_help_lists_the_keys_of_the_verbs(walker):
    text = " ".join(steering_help(walker))
    for number, verb in enumerate(walker.cfg.verbs[:9], start=1):
        assert f"{number} {verb}" in text
    assert "call" not in text, "this body has no voice"


def test_the_pointer_is_a_direction_relative_to_the_head(walker):
    head = walker.mount("head")
    ahead, right, up = (
        head.rotation.T @ (gaze_point(walker, *at) - head.position)
        for at in ((0.0, 0.0), (1.0, 0.0), (0.0, -1.0))
    )
    np.testing.assert_allclose(ahead, [3.0, 0.0, 0.0], atol=1e-9)
    assert right[1] == pytest.approx(-right[0])
    assert up[2] > 1.0


def test_samples_are_scaled_to_16_bits_and_interleaved():
    loudspeaker = pytest.importorskip("veca_marl.play.window")
    samples = np.frombuffer(loudspeaker.pcm(np.array([[0.5, 0.0], [-0.5, 0.25]]), 0.5), np.int16)
    full = round(0.8 * 32_767)
    np.testing.assert_allclose(samples, [full, -full, 0, full / 2], atol=1)
