"""Layouts of observations and actions for other libraries, and what holds for all adapters."""

import copy
import pickle

import numpy as np
import pytest
from gymnasium import spaces
from refusals import naming
from stable_baselines3.common.env_checker import check_env

from veca_marl import gym_env, make, parallel_env

CHEAP = {"playground": "simple", "senses": {"vision": "blind"}}


def joined(arrays):
    """The senses as one vector."""
    return np.concatenate([arrays[name].ravel() for name in sorted(arrays)])


@pytest.fixture
def opened():
    """Make environments that are closed at the end."""
    envs = []

    def open_(maker, *args, **choices):
        envs.append(maker(*args, **choices))
        return envs[-1]

    yield open_
    for env in envs:
        env.close()


def test_a_flat_observation_is_one_vector_of_all_senses(opened):
    env = opened(gym_env, "KickTheBall", playground="simple", layout="flat")
    plain = opened(gym_env, "KickTheBall", playground="simple")
    (vector, _), (arrays, _) = env.reset(seed=3), plain.reset(seed=3)
    assert vector in env.observation_space
    assert vector.dtype == np.float32
    np.testing.assert_array_equal(vector, joined(arrays))
    action = env.action_space.sample()
    after, *_ = env.step(action)
    expected, *_ = plain.step(action)
    np.testing.assert_array_equal(after, joined(expected))


@pytest.mark.parametrize("wrong", [7, -50])
def test_the_entries_of_a_choice_are_in_their_space(opened, wrong):
    env = opened(gym_env, "KickTheBall", body="walker_voice", layout="flat", **CHEAP)
    env.reset(seed=1)
    action = np.zeros_like(env.action_space.sample())
    action[-1] = wrong
    assert action not in env.action_space
    with pytest.raises(ValueError, match=naming("voice", str(wrong))):
        env.step(action)
    env.step(np.clip(action, -1.0, 1.0))


@pytest.mark.parametrize("wrong", [None, [np.zeros(2, np.float32)], 3])
def test_actions_that_are_no_mapping_are_refused(opened, wrong):
    env = opened(parallel_env, "KickTheBall", **CHEAP)
    env.reset(seed=1)
    with pytest.raises(ValueError, match="agent"):
        env.step(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["stacked", "flat"])
@pytest.mark.parametrize("body", ["walker_voice", "walker_discrete_voice"])
def test_actions_of_several_parts_are_one_array(opened, layout, body):
    env = opened(gym_env, "KickTheBall", body=body, layout=layout, **CHEAP)
    plain = opened(gym_env, "KickTheBall", body=body, **CHEAP)
    assert isinstance(plain.action_space, spaces.Dict)
    assert isinstance(env.action_space, (spaces.Box, spaces.MultiDiscrete))
    env.reset(seed=1)
    plain.reset(seed=1)
    env.action_space.seed(0)
    for _ in range(5):
        action = env.action_space.sample()
        one, *rest, info = env.step(action)
        other, *same, expected = plain.step(env.unwrapped._actions.parts(action))
        assert rest == same
        assert info == expected
        audio = one if layout == "flat" else one["audio"]
        np.testing.assert_array_equal(audio, other["audio"].ravel())


def test_the_largest_entry_of_a_choice_is_chosen(opened):
    env = opened(gym_env, "KickTheBall", body="walker_voice", layout="flat", **CHEAP)
    parts = env.unwrapped._actions
    calls = int(parts.specs["voice"].high) + 1
    n = parts.space.shape[0] - calls
    for call in range(calls):
        vector = np.zeros(n + calls, np.float32)
        vector[:n] = np.linspace(-0.5, 0.5, n)
        vector[n + call] = 0.1
        split = parts.parts(vector)
        assert split["voice"] == call
        others = [value for name, value in split.items() if name != "voice"]
        np.testing.assert_array_equal(np.concatenate(others), vector[:n])


@pytest.mark.parametrize("action", [np.zeros(3), np.full(7, np.nan), np.zeros((1, 7)), 3])
def test_an_impossible_array_is_refused(opened, action):
    env = opened(gym_env, "KickTheBall", body="walker_voice", layout="flat", **CHEAP)
    env.reset(seed=0)
    assert env.action_space.shape == (7,)
    with pytest.raises(ValueError, match=naming("7", "voice")):
        env.step(action)


@pytest.mark.parametrize("body", ["walker_voice", "walker_discrete_voice"])
def test_stable_baselines3_accepts_actions_of_several_parts(opened, body):
    check_env(opened(gym_env, "KickTheBall", body=body, layout="stacked", **CHEAP))


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["stacked", "flat"])
def test_agents_of_a_team_have_the_layout(opened, layout):
    env = opened(parallel_env, "PushOut2v2", layout=layout, **CHEAP)
    observations, _ = env.reset(seed=0)
    for _ in range(3):
        for name, observation in observations.items():
            assert observation in env.observation_space(name)
        actions = {name: env.action_space(name).sample() for name in env.agents}
        observations, *_ = env.step(actions)


def structure(info):
    return {
        key: structure(value) if isinstance(value, dict) else type(value)
        for key, value in info.items()
    }


@pytest.mark.parametrize("task", ["KickTheBall", "ObjectNav", "TurnBaby"])
def test_infos_of_resets_and_steps_have_the_same_entries(opened, task):
    env = opened(gym_env, task)
    _, first = env.reset(seed=0)
    *_, later = env.step(env.action_space.sample())
    assert structure(first) == structure(later)
    assert set(first["terms"].values()) == {0.0}


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
@pytest.mark.parametrize("maker", [make, gym_env, parallel_env])
def test_a_copy_is_refused_with_advice(opened, maker, copied):
    env = opened(maker, "KickTheBall", **CHEAP)
    with pytest.raises(TypeError, match=naming("seed", "function")):
        copied(env)
