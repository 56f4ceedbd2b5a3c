"""TurnBaby: the reward knows back from belly, the start is at rest, the expert turns over."""

import numpy as np
import pytest
from babies import baby_game

from veca_marl.envs.tasks.turn_baby import TurnBabyCfg
from veca_marl.sim.bodies.postures import ON_BACK, ON_BELLY


@pytest.fixture(scope="module")
def game():
    game = baby_game("TurnBaby")
    yield game
    game.close()


def terms_in(game, posture):
    """Return the terms after one step of rest in a posture."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    body.place((0.0, 0.0, 0.0), 0.7, posture)
    rest = {"agents": np.zeros(body.action_spec.shape, np.float32)}
    return game.step(rest, np.random.default_rng(0)).terms["agents"]


def test_the_belly_pays_and_the_back_costs(game):
    assert terms_in(game, ON_BACK) == pytest.approx({"torso": -1.0, "hip": -1.0}, abs=0.1)
    assert terms_in(game, ON_BELLY) == pytest.approx({"torso": 1.0, "hip": 1.0}, abs=0.1)


def test_an_episode_is_worth_ten(game):
    best = game.pay({"torso": 1.0, "hip": 1.0}) * game.max_steps
    assert best == pytest.approx(10.0)


def test_it_starts_on_the_back_at_rest_with_joints_anywhere(game):
    angles = []
    for seed in range(8):
        game.reset(np.random.default_rng(seed))
        body = game.players[0].body
        angles.append(body.joint_angles())
        rest = {"agents": np.zeros(body.action_spec.shape, np.float32)}
        for _ in range(12):
            outcome = game.step(rest, np.random.default_rng(0))
            assert np.linalg.norm(body.velocities(), axis=1).max() < 2.5  # limbs fall, none flies
        assert outcome.terms["agents"]["hip"] < -0.8
        assert outcome.terms["agents"]["torso"] < -0.8
    moving = np.ptp(angles, axis=0) > 0.0
    assert moving.sum() == 40


@pytest.mark.parametrize("body", ["mitten_limbs", "mitten_position"])
def test_the_expert_lies_on_the_belly_in_the_end(body):
    game, rng = baby_game("TurnBaby", f"body={body}"), np.random.default_rng(3)
    player = game.players[0]
    for _ in range(3):
        game.reset(rng)
        for _ in range(game.max_steps):
            row = player.body.encode(game.task.expert(player, {}))
            outcome = game.step({player.name: row}, rng)
        assert min(outcome.terms[player.name].values()) > 0.8
        assert outcome.truncated
        assert not outcome.terminated
    game.close()


def test_a_walker_is_refused():
    with pytest.raises(ValueError, match="body with joints"):
        baby_game("TurnBaby", "body=walker")


@pytest.mark.parametrize("wrong", [-1.0, 31.0, float("nan")])
def test_impossible_spreads_are_refused(wrong):
    with pytest.raises(ValueError, match="spread_deg"):
        TurnBabyCfg(spread_deg=wrong)
