"""What a client gets is what an environment of its own process returns, in every bit."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import gymnasium
import numpy as np
import pytest
import torch
from batches import leaves, play_and_compare, single_worlds
from composed import compose
from knockouts import knockout
from refusals import naming
from rollouts import digest, play
from served import gym_env, parallel_env, served, torchrl_env
from torchrl.envs import check_env_specs

from veca_marl.envs.adapters.gymnasium import VecaGymEnv
from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.rendering import CameraKind
from veca_marl.remote import layouts


def same(found, expected):
    ours, theirs = leaves(found), leaves(expected)
    assert set(ours) == set(theirs)
    for key, value in ours.items():
        assert torch.equal(value, theirs[key]), key


def test_torchrl_accepts_it(server):
    with closing(torchrl_env(server)) as env:
        check_env_specs(env)


@pytest.mark.parametrize("seed", [0, 2**64 + 5, 2**300])
def test_resets_seeds_and_episodes_by_number_are_the_same(cfg, server, seed):
    with closing(torchrl_env(server, 3, seed)) as there, closing(VecaEnv(cfg, 3, seed)) as here:
        for begin in (
            lambda env: env.reset(),
            lambda env: env.reset(),
            lambda env: env.reset(episode=7),
            lambda env: (env.set_seed(5), env.reset())[1],
        ):
            same(begin(there), begin(here))


@pytest.mark.parametrize("worlds", [1, 2, 3, 7, 16, 1000])
def test_parts_of_a_result_are_all_rows_in_their_order_and_the_last_is_one(worlds):
    parts = list(layouts.parts(worlds))
    assert [row for rows in parts for row in rows] == list(range(worlds))
    assert len(parts[-1]) == 1
    assert len(parts) <= 2 + np.log2(worlds)


def test_a_server_that_waits_without_sleeping_gives_the_same(cfg):
    with (
        served(cfg, 2, busy_wait_s=0.01) as server,
        closing(torchrl_env(server, 2)) as there,
        closing(VecaEnv(cfg, 2)) as here,
    ):
        assert digest(play(there, 10, 1)) == digest(play(here, 10, 1))


def test_a_seed_without_end_is_refused(server):
    with closing(torchrl_env(server, 1, 2**600)) as env, pytest.raises(ValueError, match="seed"):
        env.reset()


def test_a_game_with_eliminations_is_the_same():
    with (
        knockout("global_state=true") as cfg,
        served(cfg, 2, plugins=("knockout_plugin",)) as server,
    ):
        with closing(torchrl_env(server, 2)) as batch:
            batch.set_seed(7)
            singles = single_worlds(cfg, 2, seed=7)
            play_and_compare(batch, singles, steps=13)
            singles.close()
        with closing(parallel_env(server)) as there, closing(VecaParallelEnv(cfg, 0)) as here:
            play_side_by_side(there, here, steps=9)


def play_side_by_side(there, here, steps):
    """Play two `ParallelEnv` with the same actions and compare all they return."""
    rng = np.random.default_rng(0)
    found, expected = there.reset(seed=3), here.reset(seed=3)
    for _ in range(steps):
        np.testing.assert_equal(found, expected)
        assert there.agents == here.agents
        np.testing.assert_array_equal(there.state(), here.state())
        if here.agents:
            actions = {name: rng.uniform(-1.0, 1.0, 2).astype(np.float32) for name in here.agents}
            found, expected = there.step(actions), here.step(actions)
        else:
            found, expected = there.reset(), here.reset()


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.float16])
def test_an_action_keeps_its_precision(cfg, server, kind):
    with closing(gym_env(server)) as there, closing(VecaGymEnv(cfg, 0)) as here:
        there.reset(seed=1)
        here.reset(seed=1)
        action = np.array([0.1, -0.3], kind)
        np.testing.assert_equal(there.step(action), here.step(action))


def test_actions_of_several_parts_and_choices_are_the_same():
    cfg = compose(
        ["+task=BabyzumasRevenge", "senses/vision=blind", "body=walker_discrete_verbs"]
    ).game
    with (
        served(cfg, 1) as server,
        closing(gym_env(server)) as there,
        closing(VecaGymEnv(cfg, 0)) as here,
    ):
        here.action_space.seed(0)
        there.reset(seed=1)
        here.reset(seed=1)
        for _ in range(5):
            action = here.action_space.sample()
            np.testing.assert_equal(there.step(action), here.step(action))


def test_pictures_are_the_same(cfg, server):
    how = {"render_mode": "rgb_array"}
    with closing(gym_env(server, **how)) as there, closing(VecaGymEnv(cfg, 0, **how)) as here:
        there.reset(seed=1)
        here.reset(seed=1)
        np.testing.assert_array_equal(there.render(), here.render())


def test_pictures_of_any_choice_are_the_same(cfg, server):
    choices = {"camera": CameraKind.above, "width": 160, "height": 96, "panels": False}
    with closing(torchrl_env(server, 1)) as there, closing(VecaEnv(cfg, 1)) as here:
        for env in (there, here):
            env.set_seed(1)
            env.reset()
        np.testing.assert_array_equal(there.render(**choices), here.render(**choices))
        with pytest.raises(ValueError, match="1920"):
            there.render(width=4000)


def test_clients_that_play_at_once_have_worlds_of_their_own(cfg, server):
    def rolled_out(seed):
        with closing(torchrl_env(server, 1)) as env:
            return digest(play(env, 20, seed))

    with ThreadPoolExecutor(3) as threads:
        found = list(threads.map(rolled_out, (1, 2, 3)))
    with closing(VecaEnv(cfg, 1)) as here:
        assert found == [digest(play(here, 20, seed)) for seed in (1, 2, 3)]


@pytest.mark.parametrize("action", [np.zeros(3), np.full(2, np.nan), np.full(2, 1.5), "left"])
def test_an_invalid_action_is_the_same_error_and_moves_nothing(cfg, server, action):
    with closing(gym_env(server)) as there, closing(VecaGymEnv(cfg, 0)) as here:
        errors = []
        for env in (there, here):
            env.reset(seed=1)
            with pytest.raises(ValueError, match="agents") as error:
                env.step(action)
            errors.append(str(error.value))
        assert errors[0] == errors[1]
        legal = np.zeros(2, np.float32)
        np.testing.assert_equal(there.step(legal), here.step(legal))


def test_an_invalid_action_in_one_world_moves_none(cfg, server):
    with closing(torchrl_env(server, 2)) as there, closing(VecaEnv(cfg, 2)) as here:
        for env in (there, here):
            env.set_seed(1)
        states = [env.reset() for env in (there, here)]
        actions = torch.tensor([[[0.0, 0.0]], [[2.0, 0.0]]])
        wrong = states[0].clone().set(("agents", "action"), actions)
        with pytest.raises(ValueError, match=naming("world 1", "2.0")):
            there.step(wrong)
        for state in states:
            state["agents", "action"] = torch.zeros(2, 1, 2)
        same(*(env.step(s) for env, s in zip((there, here), states, strict=True)))


def test_uses_at_the_wrong_time_are_errors_of_one_line(server):
    env = gym_env(server, render_mode="rgb_array")
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros(2, np.float32))
    with pytest.raises(RuntimeError, match="reset"):
        env.render()
    env.reset()
    env.close()
    env.close()
    with pytest.raises(RuntimeError, match="closed"):
        env.reset()


def test_what_is_on_the_server_cannot_be_had_here(server):
    with closing(torchrl_env(server, 1)) as env:
        with pytest.raises(AttributeError, match=naming("'world'", "server")):
            env.games[0].world  # noqa: B018  the access
        assert "KickTheBall" in env.cfg.specs.configuration or env.cfg.task.name == "KickTheBall"


def test_spaces_are_the_same(cfg, server):
    with closing(gym_env(server)) as there, closing(VecaGymEnv(cfg, 0)) as here:
        assert there.observation_space == here.observation_space
        assert there.action_space == here.action_space
        assert there.metadata == here.metadata
        assert isinstance(there, gymnasium.Env)
