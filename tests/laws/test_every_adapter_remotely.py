"""Every task is the same game where its worlds are on a server, through every adapter."""

from contextlib import closing

import pytest
from batches import play_and_compare, single_worlds
from compared import by_player, check_observation, check_result
from rollouts import EPISODE

pytest.importorskip("msgpack", reason="worlds on a server need the extra [remote]")

from served import gym_env, parallel_env, served, torchrl_env

WORLDS, STEPS = 2, EPISODE + 5


@pytest.fixture(scope="session")
def server(cfg):
    with served(cfg, WORLDS) as server:
        yield server


@pytest.fixture(scope="session")
def steps(env, rollout):
    """Steps of the first world of the env of two, in this process: before and after, by player."""
    return [
        (by_player(step, env.group_map), by_player(step["next"], env.group_map))
        for step in rollout[0, :STEPS]
    ]


def test_a_batch_equals_single_worlds_of_this_process(cfg, server, env):
    with closing(torchrl_env(server, WORLDS)) as batch:
        for specs in ("observation_spec", "full_action_spec", "full_reward_spec", "full_done_spec"):
            assert getattr(batch, specs) == getattr(env, specs)
        batch.set_seed(7)
        singles = single_worlds(cfg, WORLDS, seed=7)
        play_and_compare(batch, singles, steps=EPISODE + 2)
        singles.close()


def test_pettingzoo_plays_the_same_game_as_torchrl_in_this_process(server, steps):
    with closing(parallel_env(server)) as env:
        observations, _ = env.reset(seed=1)
        for before, after in steps:
            if not env.agents:
                observations, _ = env.reset()
            assert set(observations) == set(before)
            for name, row in before.items():
                check_observation(observations[name], row)
            actions = {name: row["action"].numpy() for name, row in before.items()}
            observations, *results = env.step(actions)
            for name, row in after.items():
                check_observation(observations[name], row)
                check_result(*(result[name] for result in results), row)


def test_gymnasium_plays_the_same_game_as_torchrl_in_this_process(cfg, server, steps):
    if sum(team.size for team in cfg.teams) != 1:
        pytest.skip("a game of several agents")
    with closing(gym_env(server)) as env:
        observation, _ = env.reset(seed=1)
        for before, after in steps:
            (row,), (after_row,) = before.values(), after.values()
            check_observation(observation, row)
            observation, *result = env.step(row["action"].numpy())
            check_observation(observation, after_row)
            check_result(*result, after_row)
            if result[1] or result[2]:
                observation, _ = env.reset()
