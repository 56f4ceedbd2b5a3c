"""SitBaby: sitting pays, standing on the head does not, the expert comes to sit."""

import numpy as np
import pytest
from babies import baby_game

from veca_marl.envs.tasks.sit_baby import SitBabyCfg
from veca_marl.sim.bodies.postures import ON_BACK, SITTING, STANDING, Posture


@pytest.fixture(scope="module")
def game():
    game = baby_game("SitBaby")
    yield game
    game.close()


def terms_in(game, posture, seconds=0.04):
    """Return the terms after holding a posture."""
    game.reset(np.random.default_rng(1))
    body = game.players[0].body
    body.place((0.0, 0.0, 0.0), 0.7, posture)
    for _ in range(round(seconds / 0.04)):
        row = body.encode(body.angles_of(posture))
        outcome = game.step({"agents": row}, np.random.default_rng(0))
    return outcome.terms["agents"]


def test_who_sits_upright_has_all(game):
    """The numbers of the configuration are those of a child that has sat for two seconds."""
    assert terms_in(game, SITTING, 2.0) == pytest.approx({"torso": 1.0, "head": 1.0}, abs=0.03)


def test_standing_is_no_better_than_sitting(game):
    assert terms_in(game, STANDING) == {"torso": 1.0, "head": 1.0}


def test_lying_pays_little(game):
    paid = terms_in(game, ON_BACK)
    assert paid["torso"] < 0.3
    assert paid["head"] < 0.25


def test_head_down_and_waist_up_pays_no_more_than_lying(game):
    """Once the term was the height of the waist, and shoulder stands were the way to earn it."""
    shoulder_stand = Posture(-160.0, {"neck.flexion": 45.0, "head.flexion": 30.0})
    paid = terms_in(game, shoulder_stand)
    assert paid["torso"] < 0.4
    assert paid["head"] < 0.25


def test_an_episode_is_worth_ten(game):
    assert game.pay({"torso": 1.0, "head": 1.0}) * game.max_steps == pytest.approx(10.0)


def test_it_starts_on_the_back_at_rest(game):
    for seed in range(8):
        game.reset(np.random.default_rng(seed))
        body = game.players[0].body
        rest = {"agents": np.zeros(body.action_spec.shape, np.float32)}
        for _ in range(12):
            game.step(rest, np.random.default_rng(0))
            assert np.linalg.norm(body.velocities(), axis=1).max() < 2.5
        assert body.bone("chest").forward[2] > 0.8


@pytest.mark.parametrize("body", ["mitten_limbs", "mitten_position"])
def test_the_expert_sits_in_the_end(body):
    game, rng = baby_game("SitBaby", f"body={body}"), np.random.default_rng(3)
    player, ends = game.players[0], []
    for _ in range(4):
        game.reset(rng)
        for _ in range(game.max_steps):
            row = player.body.encode(game.task.expert(player, {}))
            outcome = game.step({player.name: row}, rng)
        ends.append(min(outcome.terms[player.name].values()))
        assert not outcome.terminated
    assert np.median(ends) > 0.8
    game.close()


def test_a_walker_is_refused():
    with pytest.raises(ValueError, match="body with joints"):
        baby_game("SitBaby", "body=walker")


@pytest.mark.parametrize(
    "wrong", [{"spread_deg": 40.0}, {"torso_m": 0.0}, {"head_m": float("inf")}]
)
def test_impossible_numbers_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        SitBabyCfg(**wrong)
