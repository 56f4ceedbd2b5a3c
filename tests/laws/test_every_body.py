"""The properties that every body must have in a game, whatever moves it."""

import math

import numpy as np
import pytest
from composed import compose
from gymnasium import spaces
from pettingzoo.test import parallel_api_test
from refusals import naming
from rollouts import digest, play
from torchrl.collectors import RandomPolicy
from torchrl.envs import SerialEnv, check_env_specs

from veca_marl.bench.command import free_play
from veca_marl.config import conf_dir
from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game, from_parts, random_action
from veca_marl.sim.body import MOUNTS
from veca_marl.sim.body.humanoid import Humanoid

BODIES = sorted(path.stem for path in (conf_dir() / "body").glob("*.yaml"))
# bodies of other ages, in months
GROWN = [
    pytest.param(name, marks=pytest.mark.slow)
    for name in (
        "walker@4",
        "mitten@4",
        "walker_discrete_voice@8",
        "full@8",
        "walker@18",
        "full@18",
    )
]
SENSES = ("vision", "audio", "touch", "proprioception")
STEPS = 12
# actions of each kind, with one and with several parts, for tests that build environments
ADAPTED = (
    "walker",
    "mitten",
    "walker_voice",
    "walker_discrete_voice",
    "mitten_voice",
    "full_voice",
)


@pytest.fixture(scope="module", params=[*BODIES, *GROWN])
def cfg(request):
    name, _, age = request.param.partition("@")
    size = [f"development={age}"] if age else []
    game = compose(["+task=ObjectNav", f"body={name}", *size]).game
    with free_play(game, 2, senses=SENSES) as cfg:
        yield cfg


@pytest.fixture(scope="module")
def env(cfg):
    env = VecaEnv(cfg, worlds=1)
    yield env
    env.close()


@pytest.fixture
def adapted_cfg(cfg, request):
    if request.node.callspec.params["cfg"] not in ADAPTED:
        pytest.skip("its action is of the same kind as that of another body")
    return cfg


@pytest.fixture(scope="module")
def built_game(cfg):
    game = Game(cfg)
    yield game
    game.close()


@pytest.fixture
def game(built_game):
    """The game at the start of an episode, whatever was played before."""
    built_game.reset(np.random.default_rng(0))
    return built_game


def move(game, rng, steps):
    for _ in range(steps):
        game.step({p.name: random_action(p.body.action_spec, rng) for p in game.players})


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


def test_impossible_places_are_refused(game):
    with pytest.raises(ValueError, match=naming("agents_0", "nan")):
        game.players[0].body.place((math.nan, 0.0, 0.0))


# ---- actions


def test_an_action_is_named_parts_of_two_kinds(game):
    for part, spec in game.players[0].body.action_spec.items():
        assert part in ("move", "verb", "joints", "voice")
        kind = "discrete" if spec.is_discrete else "continuous"
        bounds = (spec.shape, spec.dtype, spec.low, spec.high)
        expected = {
            "discrete": ((), np.int64, 0, len(spec.names) - 1),
            "continuous": ((len(spec.names),), np.float32, -1.0, 1.0),
        }
        assert bounds == expected[kind]
        assert len(set(spec.names)) == len(spec.names) > 1


def test_a_command_becomes_an_action_of_the_spec(game):
    body = game.players[0].body
    command = body.joint_angles() if isinstance(body, Humanoid) else (0.5, -1.0)
    action = body.encode(command)
    assert list(action) == list(body.action_spec)
    for part, spec in body.action_spec.items():
        assert (action[part].shape, action[part].dtype) == (spec.shape, np.dtype(spec.dtype))
    body.act(action)


def test_impossible_values_are_refused_with_agent_part_and_range_and_nothing_moves(game):
    body, rng = game.players[1].body, np.random.default_rng(0)
    for part, spec in body.action_spec.items():
        actions = {p.name: random_action(p.body.action_spec, rng) for p in game.players}
        wrong = np.asarray(spec.high + 1, spec.dtype) if spec.is_discrete else spec.high + 0.5
        actions["agents_1"][part] = np.full(spec.shape, wrong)
        choices = (spec.names[-1],) if spec.is_discrete else (spec.names[0], "[-1, 1]")
        before = body.bone_positions()
        with pytest.raises(ValueError, match=naming("agents_1", f"'{part}'", *choices)):
            game.step(actions)
        np.testing.assert_array_equal(body.bone_positions(), before)


def test_wrong_shapes_and_parts_are_refused(game):
    body = game.players[1].body
    actions = {
        p.name: random_action(p.body.action_spec, np.random.default_rng(0)) for p in game.players
    }
    parts, first = actions["agents_1"], repr(next(iter(body.action_spec)))
    for wrong, named in (
        ({**parts, "tail": np.zeros(1)}, "'tail'"),
        ({part: np.zeros((*spec.shape, 3)) for part, spec in body.action_spec.items()}, "action"),
        ({}, "[]"),
        (None, "action"),
    ):
        with pytest.raises(ValueError, match=naming("agents_1", first, named)):
            game.command({**actions, "agents_1": wrong})


def test_a_game_takes_the_plain_array_of_a_single_part(game):
    rng = np.random.default_rng(0)
    actions = {p.name: random_action(p.body.action_spec, rng) for p in game.players}
    plain = {name: from_parts(parts) for name, parts in actions.items()}
    several = len(actions["agents_0"]) > 1
    assert isinstance(plain["agents_0"], dict) == several
    game.step(plain)


def test_torchrl_draws_and_steps_one_leaf_or_one_for_each_part(env, cfg):
    parts = env.games[0].players[0].body.action_spec
    several = len(parts) > 1
    keys = {("agents", "action", part) for part in parts} if several else {("agents", "action")}
    assert set(env.full_action_spec.keys(True, True)) == keys
    policy = RandomPolicy(env.full_action_spec)
    rollout = env.rollout(3, policy)
    for key, part in zip(sorted(keys), sorted(parts), strict=True):
        assert rollout[key].shape == (1, 3, 2, *parts[part].shape)
        assert env.full_action_spec[key].is_in(rollout[key][:, 0])


def test_serial_worlds_step(adapted_cfg):
    env = SerialEnv(2, lambda: VecaEnv(adapted_cfg))
    rollout = env.rollout(3, RandomPolicy(env.full_action_spec))
    assert rollout.batch_size == (2, 1, 3)
    env.close()


def test_pettingzoo_has_a_plain_space_or_a_dict_of_parts(adapted_cfg):
    env = VecaParallelEnv(adapted_cfg)
    parts = env._played.game.players[0].body.action_spec
    space = env.action_space("agents_0")
    assert isinstance(space, spaces.Dict) == (len(parts) > 1)
    if len(parts) > 1:
        assert list(space) == list(parts)
    parallel_api_test(env, num_cycles=4)
    env.close()


def test_gymnasium_has_a_plain_space_or_a_dict_of_parts(adapted_cfg):
    with free_play(adapted_cfg, 1, senses=SENSES) as alone:
        env = VecaGymEnv(alone)
        env.reset(seed=0)
        action = env.action_space.sample()
        assert isinstance(action, dict) == isinstance(env.action_space, spaces.Dict)
        env.step(action)
        env.close()
