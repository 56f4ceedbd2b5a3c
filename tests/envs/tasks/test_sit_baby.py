"""SitBaby: reward, start and expert."""

import numpy as np
import pytest
from babies import (
    check_limbs_fall_and_none_flies,
    child_game,
    hold,
    play,
    put,
    starts,
)

from veca_marl.sim.body.humanoid.postures import (
    ON_ALL_FOURS,
    ON_BACK,
    SITTING,
    STANDING,
    Posture,
)


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


def test_the_terms_are_1_when_sitting_upright(game):
    """The default heights are those of a body that has been sitting for two seconds."""
    assert terms_in(game, SITTING, 2.0) == pytest.approx({"torso": 1.0, "head": 1.0}, abs=0.03)


def test_the_terms_are_clipped_when_standing_which_is_not_sitting(game):
    assert terms_in(game, STANDING) == {"torso": 1.0, "head": 1.0}
    assert not game.task.solved(game.players[0])


def test_sitting_upright_solves_the_task(game):
    terms_in(game, SITTING, 1.0)
    assert game.task.solved(game.players[0])


def test_hands_and_knees_have_a_return_of_about_2_of_10(game):
    """By the heights alone they had 7.9, more than the expert."""
    received = terms_in(game, ON_ALL_FOURS, 0.4)
    assert 1.0 < game.reward_of(received) * game.max_steps < 3.0
    assert not game.task.solved(game.players[0])


def test_the_terms_are_small_when_lying(game):
    received = terms_in(game, ON_BACK)
    assert received["torso"] < 0.3
    assert received["head"] < 0.25


def test_the_terms_are_small_in_a_shoulder_stand(game):
    """A height measured at the waist would reward shoulder stands."""
    shoulder_stand = Posture(-160.0, {"neck.flexion": 45.0, "head.flexion": 30.0})
    received = terms_in(game, shoulder_stand)
    assert received["torso"] < 0.4
    assert received["head"] < 0.25


def test_the_greatest_return_is_10(game):
    assert game.reward_of({"torso": 1.0, "head": 1.0}) * game.max_steps == pytest.approx(10.0)


def test_it_starts_on_the_back_at_rest(game):
    for body in starts(game, 8):
        check_limbs_fall_and_none_flies(game)
        assert body.bone("chest").forward[2] > 0.8


@pytest.mark.slow
@pytest.mark.parametrize(("body", "solved"), [("mitten_limbs", 4), ("mitten_position", 0)])
def test_the_expert_sits_upright_on_its_heels(body, solved):
    """A body that is controlled by target angles leans on its hands in most episodes."""
    rng, ends = np.random.default_rng(3), []
    with child_game("SitBaby", f"body={body}") as game:
        for _ in range(4):
            ends.append(play(game, rng)[0][-1])
            assert not ends[-1].terminated
    assert np.median([min(end.terms["agents"].values()) for end in ends]) > 0.4
    assert sum(end.solved["agents"] for end in ends) >= solved


def test_episodes_start_in_the_configured_postures():
    """The height and the orientation of the chest tell the postures apart."""

    def chests(**shares):
        asked = ",".join(f"{name}:{share}" for name, share in shares.items())
        with child_game("SitBaby", f"task.starts={{{asked}}}") as game:
            for seed in range(12):
                game.reset(np.random.default_rng(seed))
                chest = game.task.body.bone("chest")
                yield chest.position[2], chest.forward[2]

    assert all(forward > 0.3 for _, forward in chests())
    assert all(forward < -0.3 for _, forward in chests(on_back=0, on_belly=1))
    heights = [height for height, _ in chests(on_belly=1, sitting=2)]
    assert min(heights) < 0.15
    assert max(heights) > 0.2
