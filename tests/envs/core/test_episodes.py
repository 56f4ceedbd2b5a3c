"""The randomness of an episode depends on seed, world and episode alone."""

import numpy as np
import pytest
import torch
from composed import compose
from duels import STEPS, duel

from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.episodes import Episodes


def draws(rng):
    return rng.integers(2**63, size=4).tolist()


def test_each_episode_of_each_world_has_its_own_randomness():
    seen = {
        tuple(draws(Episodes(seed, world).next(number)))
        for seed in (0, 1)
        for world in (0, 1)
        for number in (0, 1)
    }
    assert len(seen) == 8


def test_what_an_episode_draws_does_not_change_the_next():
    one, other = Episodes(5, 2), Episodes(5, 2)
    one.next().random(100)
    other.next()
    assert draws(one.next()) == draws(other.next()) == draws(Episodes(5, 2).next(1))
    assert one.number == 2


def test_without_a_seed_each_has_its_own():
    one, other = Episodes(), Episodes()
    assert one.seed != other.seed
    assert draws(one.next()) == draws(Episodes(one.seed).next())


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Episodes(-1), "seed=-1"),
        (lambda: Episodes(0, -2), "world=-2"),
        (lambda: Episodes(0).next(-3), "episode=-3"),
    ],
)
def test_numbers_are_0_or_more(make, said):
    with pytest.raises(ValueError, match=said):
        make()


@pytest.fixture
def cfg():
    """A game in which each step draws, and an episode ends by the rules or by the time."""
    with duel("senses/vision=blind") as cfg:
        yield cfg


def headings(env):
    return [player.body.forward for game in env.games for player in game.players]


def starts_of_torchrl(cfg, value, steps):
    """Play so many steps with one action; return the headings of the players after each reset."""
    env = VecaEnv(cfg, 2, seed=3)
    found, state = [], env.reset()
    for step in range(steps):
        if step % STEPS == 0:
            found.append(headings(env))
        for team in env.group_map:
            shape = env.full_action_spec[team, "action"].shape
            state[team, "action"] = torch.full(shape, value)
        _, state = env.step_and_maybe_reset(state)
    env.close()
    return found


def test_policies_that_play_differently_start_later_episodes_alike(cfg):
    one, other = (starts_of_torchrl(cfg, value, 3 * STEPS) for value in (0.0, 1.0))
    np.testing.assert_array_equal(one, other)
    assert len(np.unique(np.round(one, 9)[..., 0])) == 3 * 2 * 3  # episodes, worlds, players


def test_an_env_can_begin_at_an_episode(cfg):
    third = starts_of_torchrl(cfg, 0.5, 3 * STEPS)[2]
    env = VecaEnv(cfg, 2, seed=3)
    env.reset(episode=2)
    np.testing.assert_array_equal(headings(env), third)
    assert [episodes.number for episodes in env.episodes] == [3, 3]
    env.close()


def test_set_seed_restarts_the_count(cfg):
    env = VecaEnv(cfg, 2, seed=3)
    starts = []
    for seed in (None, 3):
        if seed is not None:
            env.set_seed(seed)
        for _ in range(2):
            env.reset()
            starts.append(headings(env))
    np.testing.assert_array_equal(starts[:2], starts[2:])
    env.close()


def test_all_adapters_begin_at_an_episode_alike(cfg):
    torchrl, pettingzoo = VecaEnv(cfg, 2, seed=3), VecaParallelEnv(cfg, seed=3)
    torchrl.reset(episode=4)
    pettingzoo.reset(options={"episode": 4})
    bodies = [player.body.forward for player in pettingzoo._played.game.players]
    np.testing.assert_array_equal(bodies, headings(torchrl)[:3])
    pettingzoo.reset(seed=3, options={"episode": 4, "world": 1})
    bodies = [player.body.forward for player in pettingzoo._played.game.players]
    np.testing.assert_array_equal(bodies, headings(torchrl)[3:6])
    torchrl.close()
    pettingzoo.close()


def test_gymnasium_begins_at_an_episode():
    env = VecaGymEnv(compose(["+task=KickTheBall", "senses/vision=blind"]).game, seed=3)
    starts = [env.reset()[0]["audio"] for _ in range(3)]
    np.testing.assert_array_equal(env.reset(options={"episode": 1})[0]["audio"], starts[1])
    env.close()
