"""Every task is the same game through every adapter."""

import warnings

import gymnasium
import pytest
from batches import play_and_compare, single_worlds
from compared import by_player, check_observation, check_result
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test
from rollouts import EPISODE, SHORT

from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv

STEPS = EPISODE + 5


@pytest.fixture(scope="session")
def one_agent(cfg):
    return sum(team.size for team in cfg.teams) == 1


@pytest.fixture(scope="session")
def steps(env, rollout):
    """Steps of the first world of the env of two: before and after, by player."""
    return [
        (by_player(step, env.group_map), by_player(step["next"], env.group_map))
        for step in rollout[0, :STEPS]
    ]


@pytest.fixture(scope="session")
def parallel_env(cfg):
    env = VecaParallelEnv(cfg, seed=0)
    yield env
    env.close()


@pytest.fixture(scope="session")
def gym_env(task, kind, cfg):
    """The environment of the id if it has the body; a body is no argument of an id."""
    if kind == "own":
        env = gymnasium.make(f"veca_marl/{task}-v0", overrides=[SHORT]).unwrapped
    else:
        env = VecaGymEnv(cfg)
    yield env
    env.close()


def test_a_batch_equals_single_worlds_with_masks_and_partial_resets(cfg, env):
    env.set_seed(7)
    singles = single_worlds(cfg, len(env.games), seed=7)
    play_and_compare(env, singles, steps=EPISODE + 2)
    singles.close()


def test_pettingzoo_accepts_it(parallel_env):
    parallel_api_test(parallel_env, num_cycles=STEPS)


def test_pettingzoo_plays_the_same_game_as_torchrl(parallel_env, steps):
    observations, _ = parallel_env.reset(seed=1)
    for before, after in steps:
        if not parallel_env.agents:
            observations, _ = parallel_env.reset()
        assert set(observations) == set(before)
        for name, row in before.items():
            check_observation(observations[name], row)
        actions = {name: row["action"].numpy() for name, row in before.items()}
        observations, *results = parallel_env.step(actions)
        for name, row in after.items():
            check_observation(observations[name], row)
            check_result(*(result[name] for result in results), row)


def test_gymnasium_takes_games_of_one_agent(cfg, one_agent):
    if not one_agent:
        with pytest.raises(ValueError, match="parallel_env"):
            VecaGymEnv(cfg)


def test_gymnasium_accepts_it(kind, one_agent, request, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")  # it tries each render mode
    if kind != "own" or not one_agent:
        pytest.skip("an id has the task's own body, and its task one agent")
    with warnings.catch_warnings():  # sounds and proprioception have no bounds
        warnings.filterwarnings("ignore", ".*A Box observation space m(ax|in)imum value is -?inf")
        check_env(request.getfixturevalue("gym_env"))


def test_gymnasium_plays_the_same_game_as_torchrl(one_agent, steps, request):
    if not one_agent:
        pytest.skip("a game of several agents")
    env = request.getfixturevalue("gym_env")
    observation, _ = env.reset(seed=1)
    for before, after in steps:
        (row,), (after_row,) = before.values(), after.values()
        check_observation(observation, row)
        observation, *result = env.step(row["action"].numpy())
        check_observation(observation, after_row)
        check_result(*result, after_row)
        if result[1] or result[2]:
            observation, _ = env.reset()
