"""Statistics over few runs, by the definitions of Agarwal et al. 2021.

Scores are arrays ``(..., runs, tasks)`` of one arm: one score for each run on each task; an
experiment on one task has one column. Leading dimensions hold resamples. The definitions are those
of *Deep reinforcement learning at the edge of the statistical precipice* (NeurIPS 2021) and its
package rliable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
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
