"""Statistics over few runs, by the definitions of Agarwal et al. 2021.

Scores are arrays ``(..., runs, tasks)`` of one arm: one score for each run on each task; an
experiment on one task has one column. Leading dimensions hold resamples. The definitions are those
of *Deep reinforcement learning at the edge of the statistical precipice* (NeurIPS 2021) and its
package rliable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Scores = NDArray[np.float64]
Statistic = Callable[..., NDArray[np.float64]]
Interval = tuple[float, float]

RESAMPLES = 4000
CONFIDENCE = 0.95


def interquartile_mean(scores: Scores) -> Any:
    """Return the mean of the middle half of all scores, of all runs and tasks together.

    A quarter of the scores, rounded down, is left out at each end: with fewer than four scores it
    is the mean.

    Args:
        scores: ``(..., runs, tasks)``.

    Returns:
        ``(...)``.
    """
    together = scores.reshape(*scores.shape[:-2], -1)
    return stats.trim_mean(together, proportiontocut=0.25, axis=-1)


def difference(one: Scores, other: Scores) -> Any:
    """Return the interquartile mean of `one` minus that of `other`; ``(...)``."""
    return interquartile_mean(one) - interquartile_mean(other)


def probability_of_improvement(one: Scores, other: Scores) -> Any:
    """Return the probability that a run of `one` has a higher score than a run of `other`.

    All pairs of runs on a task are compared, equal scores count one half (the Mann-Whitney
    statistic divided by the number of pairs), and the tasks are averaged. The two arms may have
    different numbers of runs.

    Raises:
        ValueError: If the arms have different numbers of tasks.
    """
    tasks, others = one.shape[-1], other.shape[-1]
    if tasks != others:
        raise ValueError(f"arms of {tasks} and {others} tasks cannot be compared")
    pairs = one[..., :, None, :] - other[..., None, :, :]
    return (0.5 * (np.sign(pairs) + 1.0)).mean(axis=(-3, -2, -1))


def bootstrap_interval(
    statistic: Statistic,
    arms: Sequence[Scores],
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return the stratified bootstrap interval of a statistic of one or more arms.

    In each resample the runs of each arm on each task are drawn with replacement, independently of
    those on other tasks and in other arms. The interval is that of percentiles.

    Args:
        statistic: Takes the scores of the arms, ``(resamples, runs, tasks)`` each, and returns
            ``(resamples,)``.
        arms: Scores of each arm, ``(runs, tasks)``.
        rng: Draws the runs.
        resamples: Number of resamples.
        confidence: Probability of the interval, in (0, 1).

    Returns:
        Lower and upper end; NaN if an arm has fewer than two runs.
    """
    if min(len(scores) for scores in arms) < 2:
        return math.nan, math.nan
    values = statistic(*(_resampled(scores, resamples, rng) for scores in arms))
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(values, [tail, 100.0 - tail])
    return float(low), float(high)


def interval_of_difference(
    one: float, one_interval: Interval, other: float, other_interval: Interval
) -> Interval:
    """Return the interval of the difference of two independent estimates from theirs.

    The distances to the ends are combined as square roots of sums of squares (method of variance
    estimates recovery: Zou & Donner 2008, Construction of confidence limits about effect measures).
    """
    difference = one - other
    below = math.hypot(one - one_interval[0], other_interval[1] - other)
    above = math.hypot(one_interval[1] - one, other - other_interval[0])
    return difference - below, difference + above


def _resampled(scores: Scores, resamples: int, rng: np.random.Generator) -> Scores:
    runs, tasks = scores.shape
    return scores[rng.integers(runs, size=(resamples, runs, tasks)), np.arange(tasks)]


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
