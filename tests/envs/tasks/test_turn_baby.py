"""TurnBaby: reward, start and expert."""

import numpy as np
import pytest
from babies import (
    BODIES,
    check_limbs_fall_and_none_flies,
    child_game,
    hold,
    play,
    put,
    starts,
    terms_at_rest,
)

from veca_marl.sim.body.humanoid.postures import ON_BACK, ON_BELLY, Posture

SPINE = {"spine.flexion": 44.0, "chest.flexion": 20.0}


@pytest.fixture(scope="module")
def game():
    with child_game("TurnBaby") as game:
        yield game


def test_the_terms_are_1_on_the_belly_and_minus_1_on_the_back(game):
    assert terms_at_rest(game, ON_BACK) == pytest.approx({"torso": -1.0, "hip": -1.0}, abs=0.1)
    assert terms_at_rest(game, ON_BELLY) == pytest.approx({"torso": 1.0, "hip": 1.0}, abs=0.1)


@pytest.mark.parametrize("pitch_deg", [0.0, 60.0])
def test_sitting_folded_forwards_is_not_turned_over(game, pitch_deg):
    """The chest lies on the legs and faces down, the pelvis does not."""
    folded = Posture(pitch_deg, {"thigh.flexion": 120.0, **SPINE})
    angles = put(game, folded).posture_angles(folded)
    for _ in range(50):
        outcome = hold(game, angles)
    received = outcome.terms["agents"]
    assert received["torso"] > 0.9
    assert 0.4 < received["hip"] < 0.65
    assert not outcome.solved["agents"]


def test_the_greatest_return_is_10(game):
    best = game.reward_of({"torso": 1.0, "hip": 1.0}) * game.max_steps
    assert best == pytest.approx(10.0)


def test_it_starts_on_the_back_at_rest_with_random_joint_angles(game):
    angles = []
    for body in starts(game, 8):
        angles.append(body.joint_angles())
        outcome = check_limbs_fall_and_none_flies(game)
        assert outcome.terms["agents"]["hip"] < -0.8
        assert outcome.terms["agents"]["torso"] < -0.8
    moving = np.ptp(angles, axis=0) > 0.0
    assert moving.sum() == 40


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_the_expert_ends_on_the_belly(body):
    rng = np.random.default_rng(3)
    with child_game("TurnBaby", f"body={body}") as game:
        for _ in range(3):
            last = play(game, rng)[0][-1]
            assert min(last.terms["agents"].values()) > 0.8
            assert last.truncated
            assert not last.terminated


@pytest.mark.slow
def test_the_expert_turns_a_body_with_fingers_over():
    with child_game("TurnBaby", "body=full") as game:
        ends = [play(game, np.random.default_rng(seed))[0][-1] for seed in range(7000, 7010)]
    assert sum(end.solved["agents"] for end in ends) >= 9
