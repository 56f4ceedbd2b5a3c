"""The window, with SDL's drivers that show and play nothing, and keys as SDL reports them."""

import numpy as np
import pytest
from composed import compose

from veca_marl.algos.evaluation.evaluate import Exploration
from veca_marl.play.command import main
from veca_marl.play.session import Session
from veca_marl.play.steering import Keyboard, SteeredPolicy

pygame = pytest.importorskip("pygame", reason="the window needs the extra [play]")

TASK = ["+task=KickTheBall", "playground=simple", "task.max_seconds=0.4", "body=walker_verbs"]


@pytest.fixture
def no_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")


@pytest.fixture
def window(no_screen):
    from veca_marl.play.window import Window

    keyboard = Keyboard()
    session = Session(
        compose(TASK).game,
        lambda env: SteeredPolicy(env, keyboard),
        1,
        Exploration.deterministic,
    )
    with Window(session, "test", keyboard) as opened:
        yield opened, session.game.actors[0].body
    session.close()


def key(name, down=True):
    kind = pygame.KEYDOWN if down else pygame.KEYUP
    pygame.event.post(pygame.event.Event(kind, key=pygame.key.key_code(name)))


def ticks(window, count):
    for _ in range(count):
        window.tick()


def test_a_rebuilt_world_is_played_with_its_new_body(window):
    """A game makes new bodies when a simulation breaks down."""
    opened, before = window
    game = opened._session.game
    game.world.broken_props = ["ball"]
    opened.begin(1)
    body = game.actors[0].body
    assert body is not before
    ahead = body.mount("eye_left").rotation[:, 0]
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, button=1, pos=(1100, 360)))
    opened.tick()
    assert np.cross(ahead, body.mount("eye_left").rotation[:, 0])[2] < -0.2


def test_held_keys_walk_and_turn_the_agent(window):
    opened, body = window
    start, yaw = body.position, body.yaw_rad
    ticks(opened, 2)
    np.testing.assert_allclose(body.position[:2], start[:2], atol=1e-3)
    key("w")
    key("left")
    ticks(opened, 4)
    assert np.linalg.norm(body.position[:2] - start[:2]) > 0.1
    assert body.yaw_rad > yaw + 0.2
    key("w", down=False)
    key("left", down=False)
    opened.tick()
    yaw = body.yaw_rad
    opened.tick()
    assert body.yaw_rad == yaw


def test_pause_again_next_and_quit(window):
    opened, _ = window
    ticks(opened, 3)
    key("p")
    ticks(opened, 3)
    assert opened.paused
    assert opened.moment.steps == 3
    key("p")
    opened.tick()
    assert opened.moment.steps == 4
    key("r")
    opened.tick()
    assert (opened.episode, opened.moment.steps) == (0, 1)
    key("n")
    opened.tick()
    assert (opened.episode, opened.moment.steps) == (1, 1)
    key("escape")
    opened.tick()
    assert not opened.is_open


def test_the_next_episode_follows_after_a_second(window):
    opened, _ = window
    ticks(opened, 10)
    assert opened.moment.done
    ticks(opened, 24)
    assert opened.episode == 0
    ticks(opened, 1)
    assert opened.episode == 1


def test_the_pointer_turns_the_eyes_and_the_right_button_releases_them(window):
    opened, body = window
    opened.tick()
    ahead = body.mount("eye_left").rotation[:, 0]
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, button=1, pos=(1100, 360)))
    opened.tick()
    eye = body.mount("eye_left").rotation[:, 0]
    assert np.cross(ahead, eye)[2] < -0.2, "to the right, seen from above"
    pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, button=3, pos=(1100, 360)))
    opened.tick()
    np.testing.assert_allclose(body.mount("eye_left").rotation[:, 0], ahead, atol=1e-6)


@pytest.mark.slow
def test_the_command_watches_a_policy_in_a_window(no_screen):
    assert main([*TASK, "policy=expert", "episodes=1", "play.sound=false"]) == 0


def test_without_a_screen_the_message_names_the_video(monkeypatch, capsys):
    for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main([*TASK, "policy=random"]) == 2
    assert "video=FILE.mp4" in capsys.readouterr().err


def test_a_body_without_keys_is_refused_with_what_can_be_done(no_screen, capsys):
    assert main(["+task=TurnBaby", "senses/touch=numb"]) == 2
    message = capsys.readouterr().err
    assert "body=walker" in message
    assert "policy=expert" in message
