"""Pictures of a game."""

import numpy as np
import pytest
from composed import compose
from refusals import naming

from veca_marl.envs.core.game import Game
from veca_marl.envs.rendering import CameraKind, Film, FilmCfg, FilmQuality, Spectator
from veca_marl.envs.rendering.cameras import CameraOperator
from veca_marl.sim.touch import taxels_of

SMALL = {"width": 320, "height": 180, "quality": FilmQuality.fast}


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


def test_a_frame_has_the_size_that_is_asked_for(game):
    spectator = Spectator(game)
    assert spectator.frame().shape == (360, 640, 3)
    for choices in (SMALL, SMALL | {"panels": False}, {"width": 200, "height": 200}):
        frame = spectator.frame(**choices)
        assert frame.shape == (choices["height"], choices["width"], 3)
        assert frame.dtype == np.uint8


def test_choices_are_given_by_name(game):
    spectator = Spectator(game)
    size = {"width": 320, "height": 180}
    named = spectator.frame(**size, camera="above", quality="fast")
    kinds = {"camera": CameraKind.above, "quality": FilmQuality.fast}
    np.testing.assert_array_equal(named, Spectator(game).frame(**size, **kinds))
    with pytest.raises(ValueError, match=naming("abov", "above", "follow")):
        spectator.frame(camera="abov")
    with pytest.raises(TypeError, match=naming("size", "width", "quality")):
        spectator.frame(size=3)


def test_panels_take_room_of_the_senses_that_there_are(game):
    """Without senses the view is wider."""
    seen = game.observe(game.players[0])
    film = Film(game, FilmCfg(**SMALL))
    full = film.picture(seen)
    view = Film(game, FilmCfg(**(SMALL | {"panels": False}))).picture()
    assert full.shape == view.shape
    assert (full != view).any()
    both = film.picture({"vision": seen["vision"], "touch": np.zeros(9888, np.float32)})
    assert (both != full).any()


def test_with_touch_the_frame_shows_the_skin(game):
    spectator, touch = Spectator(game), np.zeros(9888, np.float32)
    senses = game.observe(game.players[0])
    pale = spectator.frame(senses | {"touch": touch})
    touch[taxels_of("chest")] = 1.0
    touched = spectator.frame(senses | {"touch": touch})
    assert (touched[..., 0].astype(int) - pale[..., 0] != 0).sum() > 50


def test_rendering_frames_does_not_change_the_game():
    films = []
    for watched in (False, True):
        game = Game(compose(["+task=KickTheBall"]).game)
        game.reset(np.random.default_rng(0))
        game.observe(game.players[0])
        spectator = Spectator(game)

        def watch(seen, spectator=spectator, watched=watched):
            if watched:
                spectator.frame(seen, **SMALL)

        films.append(walk(game, 5, watch))
        game.close()
    assert films[0] == films[1]


@pytest.mark.parametrize("camera", [kind for kind in CameraKind if kind is not CameraKind.eyes])
def test_every_camera_shows_the_player(game, camera):
    """The image differs without the body of the player."""
    cfg = FilmCfg(**SMALL, camera=camera, panels=False)
    film = Film(game, cfg)
    before = film.picture().astype(int)
    body = game.players[0].body
    colours = game.world.scene.surfaces.colours
    shown = game.world.scene.surfaces.objects == body.object_id
    kept = colours[shown].copy()
    colours[shown] = (0.0, 1.0, 0.0)
    painted = film.picture()
    colours[shown] = kept
    changed = (np.abs(painted - before).max(axis=-1) > 30).sum()
    assert changed > (8 if camera is CameraKind.above else 100)


def test_the_eyes_camera_sees_what_the_eyes_see(game):
    """The picture is that of the eye, where the camera is between both of them."""
    cfg = FilmCfg(width=84, height=84, camera=CameraKind.eyes, panels=False)
    picture = Film(game, cfg).picture().astype(int)
    eye = np.moveaxis(game.observe(game.players[0])["vision"][0], 0, -1).astype(int)
    assert np.corrcoef(picture.ravel(), eye.ravel())[0, 1] > 0.8


def test_no_wall_is_between_a_camera_and_its_agent(game):
    """Whatever way the agent faces, close to a corner of the room."""
    body = game.players[0].body
    scene = game.world.scene
    for kind in (CameraKind.follow, CameraKind.orbit, CameraKind.room):
        for yaw in np.linspace(0.0, 6.0, 7):
            body.place((2.5, 2.6, 0.0), yaw_rad=float(yaw))
            scene.update()
            eye = CameraOperator(game, kind, [game.players[0].name], 1.6).shot().pose.position
            assert np.abs(eye[:2]).max() < 3.0


def test_both_agents_of_two_rooms_are_seen():
    game = Game(compose(["+task=MultiAgentNav"]).game)
    game.reset(np.random.default_rng(0))
    film = Film(game, FilmCfg(**SMALL, panels=False))
    before = film.picture().astype(int)
    for player in game.players:
        shown = game.world.scene.surfaces.objects == player.body.object_id
        game.world.scene.surfaces.colours[shown] = (0.0, 1.0, 0.0)
        after = film.picture().astype(int)
        assert (np.abs(after - before).max(axis=-1) > 30).sum() > 100
        before = after
    game.close()


def test_all_agents_of_a_contest_are_in_the_picture():
    game = Game(compose(["+task=PushOut1v1", "senses/touch=numb"]).game)
    game.reset(np.random.default_rng(0))
    film = Film(game, FilmCfg(**SMALL, panels=False))
    for player in game.players:
        before = film.picture().astype(int)
        shown = game.world.scene.surfaces.objects == player.body.object_id
        game.world.scene.surfaces.colours[shown] = (0.0, 1.0, 0.0)
        changed = np.abs(film.picture().astype(int) - before).max(axis=-1) > 30
        assert changed.mean() > 0.01, "the contest fills the frame"
    game.close()


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        ({"width": 63}, ("width=63",)),
        ({"height": 361}, ("height=361", "even")),
        ({"camera": "drone"}, ("drone", "follow", "orbit")),
        ({"quality": 3}, ("quality=3", "best")),
        ({"agent": "nobody"}, ("nobody", "agents", "all")),
    ],
)
def test_impossible_choices_are_refused(game, wrong, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        Spectator(game).frame(**wrong)
