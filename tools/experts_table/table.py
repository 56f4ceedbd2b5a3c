"""The table of all stored episodes, in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tools.experts_table.play import Played
from veca_marl.algos.evaluation.comparison import interval

_HEAD = ("task", "policy", "episodes", "return", "solved", "agent steps/s", "commit", "remark")
EXPERT_AT_LEAST, RANDOM_AT_MOST = 0.95, 0.20
Remarks = Mapping[tuple[str, str], str]
"""Text by task and policy."""


def markdown(tasks: Mapping[str, Sequence[Played]], remarks: Remarks) -> str:
    """Return a table with a row for each task and policy, and a line that explains it.

    Args:
        tasks: Episodes by task.
        remarks: Text that is added to rows.
    """
    rows = [
        _row(task, policy, [one for one in episodes if one.policy == policy], remarks)
        for task, episodes in sorted(tasks.items())
        for policy in dict.fromkeys(one.policy for one in episodes)
    ]
    lines = [_line(_HEAD), _line(["---"] * len(_HEAD)), *map(_line, rows)]
    return "\n".join([_TITLE, "", *lines, "", _EXPLANATION, ""])


_TITLE = "# Experts on the frozen episodes"
_EXPLANATION = (
    "Frozen episodes, the first ones where there are fewer than 100. Return: mean and 95 % "
    "interval by Student's t. Solved: share of the episodes that ended with the goal reached, and "
    "95 % interval by Wilson. Agent steps per second of processor time: median of the episodes, "
    "without senses that the policy does not read. Remarks mark experts that solve less than "
    f"{EXPERT_AT_LEAST:.0%} and random policies that solve more than {RANDOM_AT_MOST:.0%}."
)


def _row(task: str, policy: str, episodes: Sequence[Played], remarks: Remarks) -> list[str]:
    scores = np.array([one.score for one in episodes])
    speeds = [one.steps * one.agents / one.processor_s for one in episodes]
    versions = sorted({one.version for one in episodes})
    return [
        task,
        policy,
        f"{len(episodes)} (version {', '.join(map(str, versions))})",
        _return_cell(scores),
        _solved_cell(episodes),
        f"{np.median(speeds):.0f}",
        ", ".join(dict.fromkeys(_short(one.commit) for one in episodes)),
        "; ".join(_remarks(task, policy, episodes, remarks)),
    ]


def _return_cell(scores: NDArray[np.float64]) -> str:
    low, high = interval(scores)
    bounds = "-" if len(scores) < 2 else f"{low:.2f}, {high:.2f}"
    return f"{scores.mean():.2f} [{bounds}]"


def solved_of(episodes: Sequence[Played]) -> list[float]:
    """Return the solved shares of episodes; empty for a task without a goal."""
    return [one.solved for one in episodes if one.solved is not None]


def _solved_cell(episodes: Sequence[Played]) -> str:
    shares = solved_of(episodes)
    if not shares:
        return "no goal"
    low, high = share_interval(sum(shares), len(shares))
    return f"{np.mean(shares):.0%} [{low:.0%}, {high:.0%}]"


def share_interval(successes: float, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the confidence interval of a share by Wilson (1927), for small samples and shares.

    Args:
        successes: Number of successes, from 0 to `trials`; not an integer where trials of several
            players are averaged.
        trials: Number of independent trials, 1 or more.
        confidence: Probability that the interval covers the true share.
    """
    z2 = float(stats.norm.ppf((1 + confidence) / 2)) ** 2
    share = successes / trials
    middle = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (share * (1 - share) + z2 / (4 * trials)) / trials) / (1 + z2 / trials)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def _remarks(task: str, policy: str, episodes: Sequence[Played], remarks: Remarks) -> Iterator[str]:
    shares = solved_of(episodes)
    rate = float(np.mean(shares)) if shares else None
    if rate is not None and policy == "expert" and rate < EXPERT_AT_LEAST:
        yield f"below {EXPERT_AT_LEAST:.0%}"
    if rate is not None and policy == "random" and rate > RANDOM_AT_MOST:
        yield f"above {RANDOM_AT_MOST:.0%}"
    if (task, policy) in remarks:
        yield remarks[task, policy]


def _short(commit: str) -> str:
    """Return the first digits of a commit, with the mark of a checkout that was changed."""
    digits, hyphen, mark = commit.partition("-")
    return digits[:7] + hyphen + mark


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
