"""How the returns of two policies compare, with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from veca_marl.algos.evaluation.episodes import SOLVED
from veca_marl.algos.evaluation.evaluate import Scores


def interval(values: NDArray[np.float64], confidence: float = 0.95) -> tuple[float, float]:
    """Return the confidence interval of the mean by Student's t; NaN for fewer than two values."""
    if len(values) < 2:
        return math.nan, math.nan
    error = math.sqrt(float(values.var(ddof=1)) / len(values))
    half = float(stats.t.ppf((1 + confidence) / 2, len(values) - 1)) * error
    return float(values.mean() - half), float(values.mean() + half)


def paired_difference(
    one: NDArray[np.float64], other: NDArray[np.float64], confidence: float = 0.95
) -> tuple[float, float, float]:
    """Return the mean difference of pairs and its confidence interval.

    Entries with one index belong to episodes that start alike, so differences of starts cancel.

    Raises:
        ValueError: If there are not equally many.
    """
    if one.shape != other.shape:
        raise ValueError(f"pairs need equally many episodes, got {len(one)} and {len(other)}")
    return float((one - other).mean()), *interval(one - other, confidence)


def score_rows(player: str, scores: Mapping[str, Scores]) -> list[dict[str, float | int | str]]:
    """Return a row for each team: means over the episodes and the interval of the return.

    In a task with a goal, ``solved`` is the share of the episodes that ended with the goal reached.

    Args:
        player: Name of the policy, ``policy`` or ``random``.
        scores: Team to its scores.
    """
    rows: list[dict[str, float | int | str]] = []
    for team, score in scores.items():
        low, high = interval(score.returns)
        rows.append(
            {
                "player": player,
                "team": team,
                "episodes": len(score.returns),
                "return": float(score.returns.mean()),
                "return_low": low,
                "return_high": high,
                "length": float(score.lengths.mean()),
                **solved_rate(score),
                **{n: float(values.mean()) for n, values in (score.each | score.terms).items()},
            }
        )
    return rows


def solved_rate(scores: Scores) -> dict[str, float]:
    """Return ``solved``, the share of the episodes that ended solved; empty without a goal."""
    return {} if scores.solved is None else {SOLVED: float(scores.solved.mean())}


def comparison_line(team: str, policy: Scores, baseline: Scores) -> str:
    """Return one line that compares a policy with the random baseline, episode by episode."""
    parts = [
        f"{name} {scores.returns.mean():.3f} {_bounds(*interval(scores.returns))}"
        for name, scores in (("policy", policy), ("random", baseline))
    ]
    mean, low, high = paired_difference(policy.returns, baseline.returns)
    return (
        f"{team}: return of {parts[0]}, {parts[1]}, difference {mean:.3f} "
        f"{_bounds(low, high)} (means of {len(policy.returns)} paired episodes, "
        f"95 % intervals){_solved_part(policy, baseline)}"
    )


def _bounds(low: float, high: float) -> str:
    """Return an interval as text; that of a single episode is not known."""
    return "[-, -]" if math.isnan(low) else f"[{low:.3f}, {high:.3f}]"


def _solved_part(policy: Scores, baseline: Scores) -> str:
    if policy.solved is None or baseline.solved is None:
        return ""
    ours, theirs = 100.0 * policy.solved.mean(), 100.0 * baseline.solved.mean()
    return f"; solved at the end: policy {ours:.1f} %, random {theirs:.1f} %"
