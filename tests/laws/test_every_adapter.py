"""Every task is the same game through every adapter."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test
from rollouts import game_cfg, play

from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.task import SOLVED

STEPS = 15
SHORT = "task.max_seconds=0.4"  # an episode ends within the steps, and another begins


@pytest.fixture(scope="module")
def cfg(task, kind):
    return game_cfg(task, kind, SHORT)


@pytest.fixture(scope="module")
def has_one_agent(task):
    return sum(team.size for team in game_cfg(task).teams) == 1


@pytest.fixture(scope="module")
def steps(cfg):
    """Steps of the first world of a `VecaEnv` of two: before and after, by player."""
    env = VecaEnv(cfg, worlds=2, seed=0)
    rollout = play(env, STEPS, seed=1)[0]
    group_map = env.group_map
    env.close()
    return [(by_player(step, group_map), by_player(step["next"], group_map)) for step in rollout]


def by_player(step, group_map):
    return {
        name: step[team][index]
        for team, names in group_map.items()
        for index, name in enumerate(names)
    }


def check_observation(observation, row):
    assert set(observation) == set(row["observation"].keys())
    for sense, seen in observation.items():
        expected = row["observation", sense].numpy()
        np.testing.assert_array_equal(seen, expected, err_msg=sense)
        assert seen.dtype == expected.dtype, sense


def check_result(reward, terminated, truncated, info, row):
    assert np.float32(reward) == row["reward"].item()
    assert (terminated, truncated) == (row["terminated"].item(), row["truncated"].item())
    expected = {name: value.item() for name, value in row["info"].items()}
    assert info.get(SOLVED) is expected.pop(SOLVED, None)
    others = {name: value for name, value in info.items() if name not in ("terms", SOLVED)}
    found = info["terms"] | others
    assert {name: np.float32(value) for name, value in found.items()} == expected


def test_pettingzoo_accepts_it(cfg):
    env = VecaParallelEnv(cfg, seed=0)
    parallel_api_test(env, num_cycles=STEPS)
    env.close()


def test_pettingzoo_plays_the_same_game_as_torchrl(cfg, steps):
    env = VecaParallelEnv(cfg, seed=0)
    observations, _ = env.reset(seed=1)
    for before, after in steps:
        if not env.agents:
            observations, _ = env.reset()
        assert set(observations) == set(before)
        for name, row in before.items():
            check_observation(observations[name], row)
        actions = {name: row["action"].numpy() for name, row in before.items()}
        observations, rewards, terminations, truncations, infos = env.step(actions)
        for name, row in after.items():
            check_observation(observations[name], row)
            check_result(rewards[name], terminations[name], truncations[name], infos[name], row)
    env.close()


def test_gymnasium_accepts_it(task, kind, has_one_agent):
    if kind != "own" or not has_one_agent:
        pytest.skip("an id has the task's own body, and its task one agent")
    env = gymnasium.make(f"veca_marl/{task}-v0", overrides=[SHORT])
    with warnings.catch_warnings():  # sounds and proprioception have no bounds
        warnings.filterwarnings("ignore", ".*A Box observation space m(ax|in)imum value is -?inf")
        check_env(env.unwrapped)
    env.close()


def test_gymnasium_plays_the_same_game_as_torchrl(cfg, has_one_agent, steps):
    if not has_one_agent:
        with pytest.raises(ValueError, match="parallel_env"):
            VecaGymEnv(cfg)
        return
    env = VecaGymEnv(cfg)
    observation, _ = env.reset(seed=1)
    for before, after in steps:
        (row,), (after_row,) = before.values(), after.values()
        check_observation(observation, row)
        observation, *result = env.step(row["action"].numpy())
        check_observation(observation, after_row)
        check_result(*result, after_row)
        if result[1] or result[2]:
            observation, _ = env.reset()
    env.close()
