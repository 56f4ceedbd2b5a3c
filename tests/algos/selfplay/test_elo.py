"""Elo ratings against their definition."""

import numpy as np
import pytest

from veca_marl.algos.evaluation.evaluate import Scores
from veca_marl.algos.selfplay import elo_ratings, make_match


def expected_wins(ratings, games):
    ahead = ratings[:, None] - ratings[None, :]
    wins = games / (1.0 + 10.0 ** (-ahead / 400.0))
    np.fill_diagonal(wins, 0.0)
    return wins


def test_ratings_are_recovered_from_expected_results():
    ratings = np.array([900.0, 1000.0, 1100.0, 1000.0])
    fitted = elo_ratings(expected_wins(ratings, 1000.0), prior_games=1e-3)
    np.testing.assert_allclose(fitted, ratings, atol=0.5)


def test_three_wins_of_four_are_191_points():
    """400 log10(3) = 190.8."""
    fitted = elo_ratings(np.array([[0.0, 300.0], [100.0, 0.0]]), prior_games=1e-3)
    assert fitted[0] - fitted[1] == pytest.approx(190.8, abs=0.2)


def test_a_player_without_losses_has_a_finite_rating():
    fitted = elo_ratings(np.array([[0.0, 8.0], [0.0, 0.0]]))
    assert 100.0 < fitted[0] - fitted[1] < 1500.0


def test_draws_are_half_a_game_for_each():
    np.testing.assert_allclose(elo_ratings(np.full((3, 3), 4.0)), 1000.0, atol=0.1)


@pytest.mark.parametrize("wins", [np.zeros((2, 3)), -np.ones((2, 2)), np.full((2, 2), np.nan)])
def test_invalid_tables_raise_an_error(wins):
    with pytest.raises(ValueError, match=r"^wins\b"):
        elo_ratings(wins)


def test_the_prior_must_be_positive():
    with pytest.raises(ValueError, match="prior_games=0"):
        elo_ratings(np.zeros((2, 2)), prior_games=0.0)


def scores(returns, solved=None):
    returns = np.array(returns)
    return Scores(returns, np.ones(len(returns)), {}, None if solved is None else np.array(solved))


def test_games_are_won_by_the_goal_and_not_by_shaping_rewards():
    red = scores([0.9, 2.0, -2.0], solved=[0.0, 1.0, 0.0])
    blue = scores([-0.9, -2.0, 2.0], solved=[0.0, 0.0, 1.0])
    match = make_match({"red": 0, "blue": 0}, {"red": red, "blue": blue}, draw_margin=0.5)
    assert match.wins == {"red": 1, "blue": 1}
    assert match.points == 0.5


def test_without_a_goal_games_are_won_by_the_return():
    red, blue = scores([0.9, 0.2, -2.0]), scores([-0.9, -0.2, 2.0])
    match = make_match({"red": 0, "blue": 0}, {"red": red, "blue": blue}, draw_margin=0.5)
    assert match.wins == {"red": 1, "blue": 1}
