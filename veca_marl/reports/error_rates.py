"""How often the verdict on two arms that do not differ is wrong, by their numbers of runs."""

from __future__ import annotations

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

    Runs reach the threshold after different frames; where some reach it after equal frames, or
    never, the probability is lower.

    Args:
        runs: Runs of one arm, at least 2.
        others: Runs of the other arm, at least 2.
    """
    return _rate(probability_of_improvement, 0.5, runs, others)


def _rate(statistic: Statistic, equal: float, runs: int, others: int) -> float:
    """Return how often the interval of a statistic leaves out its value for equal arms."""
    rng = np.random.default_rng(_SEED)
    decided = 0
    for _ in range(_TRIALS):
        scores: list[Scores] = [rng.standard_normal((count, 1)) for count in (runs, others)]
        low, high = bootstrap_interval(statistic, scores, rng, _RESAMPLES)
        decided += low > equal or high < equal
    return decided / _TRIALS
