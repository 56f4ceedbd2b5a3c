"""The global state: what it holds, and that every adapter shows the same one."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from composed import compose
from knockouts import knockout
from started import game_of

from veca_marl.envs.adapters.pettingzoo import VecaParallelEnv
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.core.global_state import GlobalState
from veca_marl.envs.core.task import TASKS


def with_state(cfg):
    return dataclasses.replace(cfg, global_state=True)


@pytest.mark.parametrize("task", sorted(TASKS))
def test_its_parts_cover_the_vector_and_stay_the_same(task):
    game = game_of(task)
    state = GlobalState(game)
    ends = [0, *(part.stop for part in state.parts.values())]
    assert [part.start for part in state.parts.values()] == ends[:-1]
    assert ends[-1] == state.size
    lengths = set()
    for episode in range(2):
        game.reset(np.random.default_rng(episode))
        for _ in range(3):
            for player in game.players:
                game.play_script(player, Script.random)
            game.advance()
            assert [f"task.{name}" for name in game.task.state()] == [
                name for name in state.parts if name.startswith("task.")
            ]
            read = state.read()
            assert read.dtype == np.float32
            assert np.isfinite(read).all()
            lengths.add(len(read))
    assert lengths == {state.size}
    game.close()


def test_it_holds_poses_motion_and_what_the_task_counts():
    game = game_of("KickTheBall")
    game.reset(np.random.default_rng(0))
    state, kicker, ball = GlobalState(game), game.players[0].body, game.world.props["ball"]
    game.world.step()
    read = state.read()

    def part(name):
        return read[state.parts[name]]

    np.testing.assert_allclose(part("ball.position"), ball.position, rtol=1e-6)
    np.testing.assert_allclose(part("ball.velocity"), ball.velocity, rtol=1e-6)
    np.testing.assert_allclose(part("agents.position"), kicker.position, rtol=1e-6)
    assert part("agents.forward") @ kicker.forward == pytest.approx(1.0, abs=1e-3)
    assert part("ball.sounding") == 1.0
    assert part("agents.present") == 1.0
    assert part("task.kicked") == 0.0
    assert part("task.left_s") > 0.0
    assert "agents.angles" not in state.parts  # a walker
    game.close()


def test_bodies_with_simulated_joints_show_them():
    game = game_of("TurnBaby")
    game.reset(np.random.default_rng(0))
    state, body = GlobalState(game), game.players[0].body
    np.testing.assert_allclose(
        state.read()[state.parts["agents.angles"]], body.joint_angles(), rtol=1e-6
    )
    game.close()


def test_the_torchrl_environment_shows_it_and_pettingzoo_the_same():
    cfg = compose(["+task=MultiAgentNav", "senses/vision=blind"]).game
    env, parallel = VecaEnv(with_state(cfg), 2, seed=3), VecaParallelEnv(cfg, seed=3)
    first = env.reset()
    assert "state" not in VecaEnv(cfg, 1, seed=3).observation_spec.keys()  # noqa: SIM118  a spec
    with pytest.raises(RuntimeError, match="reset"):
        parallel.state()
    parallel.reset()
    assert parallel.state_space.contains(parallel.state())
    np.testing.assert_array_equal(first["state"][0].numpy(), parallel.state())
    after = env.step(env.rand_action(first))["next", "state"]
    assert after.shape == (2, *parallel.state_space.shape)
    assert not torch.equal(after, first["state"])
    assert not torch.equal(after[0], after[1])
    env.close()
    parallel.close()
    with pytest.raises(RuntimeError, match="closed"):
        parallel.state()


def test_eliminated_players_are_marked():
    with knockout() as cfg:
        game = Game(cfg)
        game.reset(np.random.default_rng(0))
        state, seen = GlobalState(game), []
        for _ in range(6):
            game.step({player.name: np.zeros(2, np.float32) for player in game.players})
            read = state.read()
            seen.append(sum(read[state.parts[f"{p.name}.present"]][0] for p in game.players))
        assert seen == [3.0, 2.0, 2.0, 1.0, 1.0, 0.0]
        game.close()


def test_after_a_breakdown_it_is_finite_and_then_of_the_new_world():
    cfg = compose(["+task=ObjectNav", "body=mitten"]).game
    env = VecaEnv(with_state(cfg), seed=0)
    before = env.reset()
    client, body = env.games[0].world.client, env.games[0].players[0].body
    client.resetBaseVelocity(body.body_id, (math.nan,) * 3, (math.nan,) * 3)
    played, following = env.step_and_maybe_reset(env.rand_action(before))
    assert played["next", "truncated"].all()
    assert played["next", "state"].isfinite().all()
    body = env.games[0].players[0].body
    parts = GlobalState(env.games[0]).parts
    np.testing.assert_allclose(
        following["state"][0, parts["agents.position"]].numpy(), body.position, rtol=1e-6
    )
    env.close()
