"""The scores of runs over their training, from the rows of a table of results."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from veca_marl.reports.budget import FrameBudget
from veca_marl.reports.gather import state_in
from veca_marl.reports.statistics import Interval, Scores

NEVER = 1e18
"""Frames to a threshold that a run has not reached; finite, so that differences are defined."""

# columns that are no measurements
_LABELS = ("arm", "seed", "state", "player", "team", "commit", "remark")


@dataclass(frozen=True)
class Point:
    """One evaluation.

    Attributes:
        frames: Frames of training before it.
        minutes: Minutes of training, with earlier evaluations, before it; NaN if not measured.
        core_minutes: The same of processor time, of all processes.
        score: Mean of the metric over the episodes.
        episodes: Number of episodes; 0 if not stored.
    """

    frames: int
    minutes: float
    core_minutes: float
    score: float
    episodes: int


@dataclass(frozen=True)
class Run:
    """The evaluations of one run.

    Attributes:
        arm: Its arm.
        seed: Its seed.
        ended: Whether it has ended and its final score was measured; otherwise it has none.
        points: Its evaluations in the order of their frames, up to the frames asked for.
        random: Score of the random policy from the same starts; NaN if not measured.
    """

    arm: str
    seed: int
    ended: bool
    points: tuple[Point, ...]
    random: float

    @property
    def final(self) -> Point:
        """The last evaluation."""
        return self.points[-1]

    def until(self, frames: int) -> Run:
        """Return the run with its evaluations after at most so many frames."""
        return replace(self, points=tuple(p for p in self.points if p.frames <= frames))

    def reached(self, threshold: float) -> Point | None:
        """Return the first evaluation with at least this score; None if there is none."""
        return next((point for point in self.points if point.score >= threshold), None)


def runs_of(
    rows: Sequence[Mapping[str, str]],
    metric: str,
    team: str,
    budgets: Mapping[str, FrameBudget],
) -> list[Run]:
    """Return all runs in a table of results that have been evaluated at least once.

    Evaluations after the frames asked for are left out: arms are compared on the budgets that the
    experiment states. A run with such evaluations and none at its budget has not ended on it.

    Args:
        rows: The table.
        metric: Its column with the score.
        team: The team that is compared.
        budgets: Frames that the runs of each arm are asked to have.

    Raises:
        ValueError: If there is no such column.
    """
    own: dict[tuple[str, int], list[Mapping[str, str]]] = {}
    for row in rows:
        if row["team"] == team and row["player"] in ("policy", "random"):
            if metric not in row or metric in _LABELS:
                raise _no_metric(metric, row)
            own.setdefault((row["arm"], int(row["seed"])), []).append(row)
    made = [_run(arm, seed, mine, metric, budgets[arm]) for (arm, seed), mine in own.items()]
    return [run for run in made if run.points]


def _no_metric(metric: str, row: Mapping[str, str]) -> ValueError:
    choices = [name for name in row if name not in _LABELS]
    return ValueError(f"experiment.metric={metric}: choices: {', '.join(choices)}")


def _run(
    arm: str,
    seed: int,
    rows: Sequence[Mapping[str, str]],
    metric: str,
    budget: FrameBudget,
) -> Run:
    policy = [row for row in rows if row["player"] == "policy"]
    by_frames = {int(row["frames"]): _point(row, metric) for row in policy}  # the last of equals
    shown = sorted(at for at in by_frames if budget.includes(at))
    random = [_number(row[metric]) for row in rows if row["player"] == "random"]
    points = tuple(by_frames[frames] for frames in shown)
    measured = bool(points) and not math.isnan(points[-1].score)
    ended = measured and budget.counts(state_in(rows), by_frames)
    return Run(arm, seed, ended, points, random[-1] if random else math.nan)


def _point(row: Mapping[str, str], metric: str) -> Point:
    return Point(
        int(row["frames"]),
        _number(row.get("minutes", "")),
        _number(row.get("core_minutes", "")),
        _number(row[metric]),
        int(row.get("episodes") or 0),
    )


def _number(text: str) -> float:
    return float(text) if text else math.nan


def final_scores(runs: Iterable[Run]) -> Scores:
    """Return the final scores of runs that have ended, ``(runs, 1)``."""
    return np.array([[run.final.score] for run in runs if run.ended], float).reshape(-1, 1)


def random_scores(runs: Iterable[Run]) -> Scores:
    """Return the scores of the random policy beside runs that have ended, ``(runs, 1)``."""
    return np.array([[run.random] for run in runs if run.ended], float).reshape(-1, 1)


class ExpertScore(NamedTuple):
    """The score of the expert of a task.

    Attributes:
        score: Mean over its episodes.
        interval: Its 95 % interval over the episodes; NaN for another metric than the return.
    """

    score: float
    interval: Interval = (math.nan, math.nan)


def expert_score(rows: Sequence[Mapping[str, str]], metric: str, team: str) -> ExpertScore | None:
    """Return the score of the expert, of several rows the mean of each number; None without."""
    own = [row for row in rows if (row["player"], row["team"]) == ("expert", team)]
    if not own:
        return None
    score, low, high = (
        float(np.mean([_number(row.get(name, "")) for row in own]))
        for name in (metric, f"{metric}_low", f"{metric}_high")
    )
    return ExpertScore(score, (low, high))


def team_of(
    rows: Sequence[Mapping[str, str]], asked: str | None, opponents: Container[str] = ()
) -> str:
    """Return the team that is compared.

    Args:
        rows: The table of results.
        asked: The team that the experiment names; None is the only one that learns.
        opponents: Teams that do not learn.

    Raises:
        ValueError: If there is no such team, or several and none is named.
    """
    teams = sorted({row["team"] for row in rows})
    learning = [team for team in teams if team not in opponents]
    if asked is None and len(learning) == 1:
        return learning[0]
    if asked not in teams:
        raise ValueError(f"experiment.team={asked}: choices: {', '.join(teams)}")
    return asked


def frames_to(threshold: float, runs: Iterable[Run]) -> Scores:
    """Return the frames until runs reached a threshold, ``(runs, 1)``.

    Runs that did not reach it have `NEVER`, so that they are equal among themselves.
    """
    points = [run.reached(threshold) for run in runs]
    frames = [NEVER if point is None else float(point.frames) for point in points]
    return np.array(frames, float).reshape(-1, 1)
