"""FillFraction: the pieces, refusal, rewards, exploits, configuration, the expert."""

import math
from fractions import Fraction

import numpy as np
import pytest
import started
from refusals import naming

from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.tasks.sorting.fill_fraction import RADIUS_M, division
from veca_marl.sim.body.walker import WalkCommand

SMALL_EYES = ("senses.vision.width=32", "senses.vision.height=32")


def game_of(*overrides):
    return started.game_of("FillFraction", *SMALL_EYES, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


def stand_before(game, circle):
    """Put the agent in front of a circle, everything else far away."""
    game.reset(np.random.default_rng(0))
    for number, one in enumerate([*game.task.circles, *game.task.pieces]):
        one.place(np.array([-2.0, -2.5 + 0.45 * number, 0.0]), 0.0)
    game.task.circles[circle].place(np.array([2.0, 0.0, 0.0]), 0.3)
    game.players[0].body.place((1.1, 0.0, 0.0))
    game.world.refresh()


def do(game, verb="none"):
    """Play one step; return whether the verb had an effect, and the reward."""
    body = game.players[0].body
    outcome = game.step({"agents": body.encode(WalkCommand(0.0, 0.0, verb=verb))})
    return body.applied_verb is not None, game.reward_of(outcome.terms["agents"])


def put(game, number):
    """Put a piece into the circle ahead."""
    assert game.players[0].body.grab(game.task.pieces[number].prop)
    game.world.refresh()
    return do(game, "put_into")


def test_pieces_are_rewarded_by_what_they_fill_and_a_full_circle_in_addition(game):
    stand_before(game, 0)
    assert put(game, 0) == (True, 0.5)
    assert put(game, 3) == (True, 0.25)
    applied, reward = put(game, 4)
    assert applied
    assert reward == pytest.approx(0.25 + 1.0)
    assert game.task.circles[0].filled == 1


def test_a_piece_that_would_overfill_is_refused_and_stays_in_the_hand(game):
    stand_before(game, 0)
    put(game, 0)
    put(game, 5)
    assert put(game, 1) == (False, 0.0)
    assert game.players[0].body.verb_was_refused
    assert game.players[0].body.held is game.task.pieces[1].prop
    assert game.task.circles[0].filled == Fraction(5, 6)


def test_pieces_lie_side_by_side_inside_the_circle_and_stay_there(game):
    stand_before(game, 0)
    for number in (0, 3, 4):
        put(game, number)
    for _ in range(25):
        do(game)
    circle = game.task.circles[0]
    yaw = math.atan2(circle.prop.rotation[1, 0], circle.prop.rotation[0, 0])
    turns = []
    for piece in circle.content:
        np.testing.assert_allclose(piece.prop.position[:2], circle.prop.position[:2], atol=1e-6)
        assert piece.prop.position[2] == pytest.approx(0.04, abs=1e-6)
        ahead = piece.prop.rotation[:, 0]
        turns.append((math.atan2(ahead[1], ahead[0]) - yaw) % math.tau / math.tau)
    np.testing.assert_allclose(turns, [0.25, 0.625, 0.875], atol=1e-6)
    low, high = circle.prop.bounds()
    assert (high - low)[0] / 2.0 > RADIUS_M


def test_taking_pieces_out_and_putting_them_in_again_has_no_return(game):
    stand_before(game, 0)
    total = put(game, 0)[1] + put(game, 1)[1]
    assert total == 2.0
    for _ in range(3):
        applied, reward = do(game, "grab")
        assert applied
        assert reward == -1.5
        total += reward + do(game, "put_into")[1]
    assert total == 2.0
    assert game.task.circles[0].filled == 1


def test_grabbing_and_releasing_has_no_return(game):
    stand_before(game, 0)
    game.players[0].body.grab(game.task.pieces[0].prop)
    rewards = [do(game, "release")[1], do(game)[1]]
    game.players[0].body.grab(game.task.pieces[0].prop)
    assert [*rewards, do(game)[1]] == [0.0, 0.0, 0.0]


def test_full_circles_end_the_episode_solved_and_the_next_one_begins_empty(game):
    player = game.players[0]
    circles = division(game.cfg.task.pieces, 3)
    game.reset(np.random.default_rng(1))
    for number, circle in enumerate(circles):
        assert not game.task.solved(player)
        game.task.circles[circle].put(game.task.pieces[number].prop)
        do(game)
    assert game.task.solved(player)
    assert game.task.terminated()
    game.reset(np.random.default_rng(2))
    assert not game.task.solved(player)
    assert all(circle.filled == 0 for circle in game.task.circles)


@pytest.mark.parametrize(
    ("pieces", "circles", "possible"),
    [
        ([2, 2], 1, True),
        ([2, 3, 6], 1, True),
        ([6, 2, 3, 4, 2, 4], 2, True),
        ([3, 2, 6, 2, 3, 6], 2, True),
        ([2, 2, 2], 1, False),
        ([2, 3], 1, False),
        ([4, 4, 3, 3, 3, 4, 4], 2, True),
        ([2, 4, 3, 3, 3, 4, 5, 5, 5, 5, 5], 3, True),
        ([2, 4, 8, 8, 8, 8, 2], 2, False),
    ],
)
def test_a_division_fills_all_circles_or_there_is_none(pieces, circles, possible):
    sizes = [Fraction(1, piece) for piece in pieces]
    found = division(pieces, circles)
    assert (found is not None) == possible
    if found is not None:
        for circle in range(circles):
            assert sum(s for s, c in zip(sizes, found, strict=True) if c == circle) == 1


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["task.pieces=[2,2,7]"], ("task.pieces", "[7]", "[1, 2, 3")),
        (["task.pieces=[2,2,2]"], ("task.pieces=[2, 2, 2]", "task.circles=3")),
        (["task.apart_m=0.2"], ("task.apart_m=0.2",)),
        (["body.verbs=[grab]"], ("body.verbs=['grab']", "['put_into']")),
    ],
)
def test_impossible_values_are_errors_that_name_them(words, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        game_of(*words)


def test_the_expert_fills_the_circles(game):
    game.reset(np.random.default_rng(3))
    done = False
    while not done:
        game.play_script(game.players[0], Script.expert)
        done = game.advance().done
    assert game.task.solved(game.players[0])
