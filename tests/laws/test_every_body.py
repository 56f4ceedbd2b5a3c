"""The properties that every body must have in a game, whatever moves it."""

import math

import numpy as np
import pytest
from rollouts import digest, play, random_row
from torchrl.envs import check_env_specs

from veca_marl.bench.free_play import free_play
from veca_marl.config.root import CONF, compose
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.sim.body.base import MOUNTS

BODIES = sorted(path.stem for path in (CONF / "body").glob("*.yaml"))
SENSES = ("vision", "audio", "touch", "proprioception")
STEPS = 12


@pytest.fixture(scope="module", params=BODIES)
def cfg(request):
    game = compose(["+task=KickTheBall", f"body={request.param}"]).game
    with free_play(2, game.task, SENSES) as task:
        yield GameCfg(task, game.playground, game.body, game.senses, game.clock)


@pytest.fixture(scope="module")
def env(cfg):
    env = VecaEnv(cfg, worlds=1)
    yield env
    env.close()


@pytest.fixture
def game(cfg):
    game = Game(cfg)
    game.reset(np.random.default_rng(0))
    yield game
    game.close()


def move(game, rng, steps):
    for _ in range(steps):
        rows = {p.name: random_row(p.body.action_spec, rng) for p in game.players}
        game.step(rows)


def test_specs_hold(env):
    check_env_specs(env, break_when_any_done="both")


def test_the_same_seed_gives_the_same_bytes(env):
    first = digest(play(env, STEPS, seed=1))
    play(env, 5, seed=2)
    assert digest(play(env, STEPS, seed=1)) == first


def test_no_sense_is_constant(env):
    rollout = play(env, STEPS, seed=1)
    for name, seen in rollout["agents", "observation"].items():
        assert (seen[0, 1:] != seen[0, :-1]).flatten(1).any(1).all(), name


def test_names_and_numbers_are_those_of_the_table(game):
    body = game.players[0].body
    move(game, np.random.default_rng(1), 5)
    assert (len(body.bone_names), len(body.joint_names)) == (47, 82)
    for array, count in (
        (body.bone_positions(), 47),
        (body.bone_rotations(), 47),
        (body.velocities(), 47),
        (body.angular_velocities(), 47),
        (body.joint_angles(), 82),
        (body.joint_velocities(), 82),
        (body.joint_torques(), 82),
    ):
        assert len(array) == count
        assert np.isfinite(array).all()
    assert body.is_finite
    np.testing.assert_array_equal(body.position, body.bone("pelvis").position)
    assert np.linalg.norm(body.forward) == pytest.approx(1.0)


def test_organs_are_in_the_head(game):
    body = game.players[0].body
    move(game, np.random.default_rng(1), 5)
    for name in MOUNTS:
        organ = body.mount(name)
        assert np.linalg.norm(organ.position - body.bone("head").position) < 0.14
        np.testing.assert_allclose(organ.rotation @ organ.rotation.T, np.eye(3), atol=1e-9)


def test_eyes_turn_to_a_point_and_the_voice_is_heard(game):
    body = game.players[0].body
    eye = body.mount("eye_left")
    body.look_toward_point(eye.position + eye.rotation @ np.array([1.0, 0.3, 0.1]))
    assert not np.allclose(body.mount("eye_left").rotation, eye.rotation)
    body.release_look()
    np.testing.assert_array_equal(body.mount("eye_left").rotation, eye.rotation)
    body.make_sound(0.1 * np.sin(np.arange(2000, dtype=np.float32)))


def test_what_it_is_told_wrongly_is_refused(game):
    body = game.players[0].body
    with pytest.raises(ValueError, match="action"):
        body.act(np.full(body.action_spec.shape, np.nan))
    with pytest.raises(ValueError, match="cannot"):
        body.place((math.nan, 0.0, 0.0))


def test_a_wish_becomes_a_row_of_the_spec(game):
    body = game.players[0].body
    row = body.encode(game.expert_of(game.players[0]).act({}))
    assert (row.shape, row.dtype) == (body.action_spec.shape, np.dtype(body.action_spec.dtype))
    body.act(row)
