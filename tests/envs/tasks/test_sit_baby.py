"""SitBaby: sitting pays, standing on the head does not, the expert comes to sit."""

import numpy as np
import pytest
from babies import (
    BODIES,
    check_limbs_fall_and_none_flies,
    check_walkers_are_refused,
    child_game,
    hold,
    play,
    put,
    starts,
)

from veca_marl.config import ConfigError, compose
from veca_marl.envs.tasks.locomotion.sit_baby import SitBabyCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK, SITTING, STANDING, Posture


@pytest.fixture(scope="module")
def game():
    with child_game("SitBaby") as game:
        yield game


def terms_in(game, posture, seconds=0.04):
    """Return the terms after holding a posture."""
    angles = put(game, posture).posture_angles(posture)
    for _ in range(round(seconds / 0.04)):
        outcome = hold(game, angles)
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
    assert game.reward_of({"torso": 1.0, "head": 1.0}) * game.max_steps == pytest.approx(10.0)


def test_it_starts_on_the_back_at_rest(game):
    for body in starts(game, 8):
        check_limbs_fall_and_none_flies(game)
        assert body.bone("chest").forward[2] > 0.8


@pytest.mark.parametrize("body", BODIES)
def test_the_expert_sits_in_the_end(body):
    rng, ends = np.random.default_rng(3), []
    with child_game("SitBaby", f"body={body}") as game:
        for _ in range(4):
            last = play(game, rng)[0][-1]
            ends.append(min(last.terms["agents"].values()))
            assert not last.terminated
    assert np.median(ends) > 0.8


def test_a_walker_is_refused():
    check_walkers_are_refused("SitBaby")


@pytest.mark.parametrize(
    "wrong", [{"spread_deg": 40.0}, {"torso_m": 0.0}, {"head_m": float("inf")}]
)
def test_impossible_numbers_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        SitBabyCfg(**wrong)


def test_episodes_begin_in_the_postures_that_are_asked_for():
    """Lying, a chest is low and looks up or down; on all fours it is higher, sitting upright."""

    def chests(**shares):
        asked = ",".join(f"{name}:{share}" for name, share in shares.items())
        with child_game("SitBaby", f"task.starts={{{asked}}}") as game:
            for seed in range(12):
                game.reset(np.random.default_rng(seed))
                chest = game.task.body.bone("chest")
                yield chest.position[2], chest.forward[2]

    assert all(forward > 0.7 for _, forward in chests())
    assert all(forward < -0.7 for _, forward in chests(on_back=0, on_belly=1))
    heights = [height for height, _ in chests(on_belly=1, sitting=2)]
    assert min(heights) < 0.1
    assert max(heights) > 0.2


@pytest.mark.parametrize("starts", ["{on_back:0}", "{on_back:-1,sitting:2}", "{sitting:inf}"])
def test_impossible_shares_of_starts_are_refused(starts):
    with pytest.raises(ConfigError, match=r"task.starts=.* must be shares"):
        compose(["+task=SitBaby", f"task.starts={starts}"])
