"""A non-finite state of a body or prop truncates the episode; the next one has a new world."""

import logging
import math

import numpy as np
import pytest
import torch
from composed import compose

from veca_marl.bench.command import free_play
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game

CFG = compose(["+task=ObjectNav", "body=mitten"]).game
SENSES = ("vision", "audio", "proprioception")


@pytest.fixture
def cfg():
    with free_play(CFG, 2, senses=SENSES) as cfg:
        yield cfg


def break_down(game, speed=math.nan):
    """Give a body a velocity as that of an unstable simulation."""
    body = game.players[0].body
    velocity = (speed,) * 3
    game.world.client.resetBaseVelocity(body.body_id, velocity, velocity)


@pytest.mark.parametrize("speed", [math.nan, math.inf, 1e10, 1e100])
def test_the_episode_is_truncated_the_cause_is_logged_and_data_are_finite(cfg, caplog, speed):
    env = VecaEnv(cfg, worlds=2, seed=0)
    state = env.reset()
    break_down(env.games[1], speed)
    with caplog.at_level(logging.WARNING):
        after = env.step(env.rand_action(state))["next"]
    assert after["truncated"].squeeze(-1).tolist() == [False, True]
    assert not after["terminated"].any()
    for key, value in after.items(True, True):
        assert torch.isfinite(value).all(), key
    (record,) = [r for r in caplog.records if r.name == "veca_marl.envs.core.game"]
    assert "agents_0" in record.getMessage()
    env.close()


@pytest.mark.parametrize("speed", [2e3, 1e6])
def test_a_speed_that_bullet_cuts_is_noticed_in_the_step_in_which_it_occurs(cfg, speed):
    """Wherever the body stands: high above the floor it touches nothing."""
    game = Game(cfg)
    game.reset(np.random.default_rng(0))
    body = game.players[0].body
    for height_m in (0.0, 50.0):
        body.place((0.0, 0.0, height_m))
        assert body.is_finite
    break_down(game, speed)
    game.world.step()
    assert not body.is_finite
    game.close()


PROPS = [  # tasks whose steps read a prop, and whose bodies collide with it
    (["+task=KickTheBall"], "ball"),
    (["+task=GrabObject"], "toy"),
    (["+task=SoccerOnePlayer", "body=walker"], "ball"),
]


@pytest.mark.parametrize("speed", [math.nan, math.inf])
@pytest.mark.parametrize(("words", "prop"), PROPS, ids=lambda value: str(value))
def test_a_broken_prop_ends_the_episode_as_a_broken_body_does(words, prop, speed, caplog):
    env = VecaEnv(compose([*words, "senses/vision=blind"]).game, worlds=1, seed=0)
    sound = VecaEnv(env.cfg, worlds=1, seed=0)
    state, game = env.reset(), env.games[0]
    body_id, client = game.world.prop(prop).body_id, game.world.client
    client.resetBaseVelocity(body_id, (speed,) * 3)
    with caplog.at_level(logging.WARNING):
        after = env.step(env.rand_action(state))["next"]
    assert bool(after["truncated"].all())
    (record,) = [r for r in caplog.records if r.name == "veca_marl.envs.core.game"]
    assert f" {prop} " in record.getMessage()
    for key, value in after.items(True, True):
        assert torch.isfinite(value).all(), key
    for team in env.group_map:
        assert not after[team, "reward"].any()
        assert not any(value.any() for value in after[team, "info"].values())
    following, expected = env.reset(), sound.reset()
    expected = sound.reset()  # its second episode
    for key, value in expected.items(True, True):
        assert torch.equal(following[key], value), key
    env.close()
    sound.close()


def test_the_next_episode_is_as_in_a_new_world(cfg):
    broken, sound = Game(cfg), Game(cfg)
    broken.reset(np.random.default_rng(0))
    break_down(broken)
    rows = {player.name: np.zeros(82) for player in broken.players}
    assert broken.step(rows).truncated
    films = []
    for game in (broken, sound):
        rng = np.random.default_rng(3)
        game.reset(rng)
        film = []
        for player in game.players:
            game.observe(player)
        for _ in range(10):
            assert not game.step(rows).truncated
            film.append({p.name: game.observe(p) for p in game.players})
            film[-1] = {n: {k: v.copy() for k, v in seen.items()} for n, seen in film[-1].items()}
        films.append(film)
        game.close()
    for ours, theirs in zip(*films, strict=True):
        for player, senses in ours.items():
            for name, seen in senses.items():
                np.testing.assert_array_equal(seen, theirs[player][name])


def test_pettingzoo_continues_in_a_new_world(cfg):
    broken, sound = (VecaParallelEnv(cfg, render_mode="rgb_array") for _ in range(2))
    broken.reset(seed=0)
    break_down(broken._played.game)
    *_, truncations, _ = broken.step({name: np.zeros(82) for name in broken.agents})
    assert truncations == {"agents_0": True, "agents_1": True}
    assert broken.agents == []
    np.testing.assert_equal(broken.reset(seed=1), sound.reset(seed=1))
    np.testing.assert_array_equal(broken.render(), sound.render())
    broken.close()
    sound.close()
