"""How often the verdict on two arms that do not differ is wrong, by their numbers of runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from veca_marl.reports.statistics import (
    Scores,
    Statistic,
    bootstrap_interval,
    difference,
    probability_of_improvement,
)

_TRIALS, _RESAMPLES = 4000, 400
_SEED = 0
_LEVELS = (3, 4)  # numbers of evaluations at which runs reach a threshold
Draw = Callable[[np.random.Generator, int], Scores]
"""Draws the scores ``(runs, 1)`` of some runs."""


@cache
def false_order_rate(runs: int, others: int) -> float:
    """Return the probability that ``ARM > OTHER`` is decided for two arms that do not differ.

    The scores of all runs are drawn from one normal distribution; its mean and scale make no
    difference. A decision is a 95 % bootstrap interval of the difference of the interquartile means
    that does not contain 0. With exact intervals the probability would be 0.05; those of few runs
    are too narrow. Simulated with a fixed seed; the standard error is at most 0.008.

    Args:
        runs: Runs of one arm, at least 2.
        others: Runs of the other arm, at least 2.
    """
    return _rate(difference, 0.0, runs, others)


@cache
def false_speed_rate(runs: int, others: int) -> float:
    """Return the same for ``ARM faster than OTHER``, which depends on the order of all runs alone.

    Runs are evaluated at few frames, so that some reach the threshold after equal frames, or never:
    the probability is the largest of those with different frames and with `_LEVELS` equally likely
    ones.

    Args:
        runs: Runs of one arm, at least 2.
        others: Runs of the other arm, at least 2.
    """

    def few(levels: int) -> Draw:
        return lambda rng, count: rng.integers(levels, size=(count, 1)).astype(float)

    draws = [_normal, *map(few, _LEVELS)]
    return max(_rate(probability_of_improvement, 0.5, runs, others, draw) for draw in draws)


def _normal(rng: np.random.Generator, count: int) -> Scores:
    return rng.standard_normal((count, 1))


def _rate(
    statistic: Statistic, equal: float, runs: int, others: int, draw: Draw = _normal
) -> float:
    """Return how often the interval of a statistic leaves out its value for equal arms."""
    rng = np.random.default_rng(_SEED)
    decided = 0
    for _ in range(_TRIALS):
        scores: list[Scores] = [draw(rng, count) for count in (runs, others)]
        low, high = bootstrap_interval(statistic, scores, rng, _RESAMPLES)
        decided += low > equal or high < equal
    return decided / _TRIALS
