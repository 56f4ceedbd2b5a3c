"""Elo ratings from a table of results, fitted to all games at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_expit

POINTS_PER_NEPER = 400.0 / math.log(10.0)


def elo_ratings(
    wins: NDArray[np.float64], mean: float = 1000.0, prior_games: float = 1.0
) -> NDArray[np.float64]:
    """Return the ratings under which the results are most likely.

    In Elo's model a player rated d points higher has the expected score 1 / (1 + 10^(-d / 400)).
    The likelihood of all games is maximised at once (Bradley & Terry 1952), so that the ratings do
    not depend on the order of the games, as ratings that are updated after each game do.

    Args:
        wins: ``(n, n)`` number of games that i won against j; a draw is half a game for each.
        mean: Mean of the ratings.
        prior_games: Drawn games of each player against one of rating `mean`; more than 0, so that
            the rating of a player that won all games is finite.

    Returns:
        ``(n,)`` Elo points.

    Raises:
        ValueError: If `wins` is not a square table of numbers that are 0 or more.
    """
    if wins.ndim != 2 or wins.shape[0] != wins.shape[1] or not (wins >= 0.0).all():
        raise ValueError(f"wins must be a square table of numbers, 0 or more; got {wins!r}")
    if not prior_games > 0.0:
        raise ValueError(f"prior_games={prior_games} must be positive")

    def negative_log_likelihood(strengths: NDArray[np.float64]) -> float:
        ahead = strengths[:, None] - strengths[None, :]
        drawn = log_expit(strengths) + log_expit(-strengths)
        return -float((wins * log_expit(ahead)).sum() + 0.5 * prior_games * drawn.sum())

    fitted = minimize(negative_log_likelihood, np.zeros(len(wins)), method="BFGS")
    strengths: NDArray[np.float64] = fitted.x - fitted.x.mean()
    return mean + POINTS_PER_NEPER * strengths
