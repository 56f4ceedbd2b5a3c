"""The scores of runs, arms and experts, from the rows of a table of results."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from veca_marl.algos.evaluation.comparison import score_rows
from veca_marl.algos.evaluation.evaluate import Exploration, evaluate
from veca_marl.algos.training.loop import evaluation_seed
from veca_marl.envs.adapters.torchrl import ExpertPolicy
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import find_expert, has_expert, missing_needs
from veca_marl.reports.arms import Arm, FrameBudget
from veca_marl.reports.gather import state_in
from veca_marl.reports.statistics import Interval, Scores, bootstrap_interval, interquartile_mean
from veca_marl.stored_files import Row

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


_SEED = 0


@dataclass(frozen=True)
class CurvePoint:
    """Interquartile mean over the runs of an arm at one number of frames.

    Attributes:
        frames: Frames of training.
        minutes: Mean minutes of training; NaN if not measured.
        core_minutes: The same of processor time, of all processes.
        score: Interquartile mean.
        interval: Its 95 % bootstrap interval; NaN with one run.
        runs: Number of runs that were evaluated there.
    """

    frames: int
    minutes: float
    core_minutes: float
    score: float
    interval: Interval
    runs: int


@dataclass(frozen=True)
class ArmSummary:
    """The final scores of an arm.

    Attributes:
        arm: Its name.
        ended: Number of ended runs.
        score: Interquartile mean of their final scores; NaN without runs.
        interval: Its 95 % bootstrap interval; NaN with fewer than two runs.
        reached: Number of ended runs that reached the threshold.
        frames: Median frames until the threshold; of an even number the higher of the two in
            the middle; infinite unless more than half reached it, NaN without a threshold.
        minutes: Median minutes of training until the threshold, likewise.
        core_minutes: The same of processor time, of all processes.
        random: Mean score of the random policy beside the ended runs; NaN if not measured.
    """

    arm: str
    ended: int
    score: float
    interval: Interval
    reached: int
    frames: float
    minutes: float
    core_minutes: float
    random: float


def curve(runs: Sequence[Run]) -> list[CurvePoint]:
    """Return the curve of an arm, at all frames at which one of its runs was evaluated."""
    frames = sorted({point.frames for run in runs for point in run.points})
    return [_curve_point(runs, at) for at in frames]


def _curve_point(runs: Sequence[Run], frames: int) -> CurvePoint:
    points = [point for run in runs for point in run.points if point.frames == frames]
    scores = np.array([[point.score] for point in points])
    return CurvePoint(
        frames,
        float(np.mean([point.minutes for point in points])),
        float(np.mean([point.core_minutes for point in points])),
        float(interquartile_mean(scores)),
        bootstrap_interval(interquartile_mean, [scores], np.random.default_rng(_SEED)),
        len(points),
    )


def summarise(arm: str, runs: Sequence[Run], threshold: float | None) -> ArmSummary:
    """Return the numbers of an arm; runs that have not ended are left out."""
    ended = [run for run in runs if run.ended]
    if not ended:
        return ArmSummary(arm, 0, math.nan, (math.nan, math.nan), 0, *[math.nan] * 4)
    scores = final_scores(ended)
    interval = bootstrap_interval(interquartile_mean, [scores], np.random.default_rng(_SEED))
    passed = [None if threshold is None else run.reached(threshold) for run in ended]
    reached = [point for point in passed if point is not None]
    late = [math.inf if threshold is not None else math.nan] * (len(ended) - len(reached))
    return ArmSummary(
        arm,
        len(ended),
        float(interquartile_mean(scores)),
        interval,
        len(reached),
        _median([*(float(point.frames) for point in reached), *late]),
        _median([*(point.minutes for point in reached), *late]),
        _median([*(point.core_minutes for point in reached), *late]),
        float(random_scores(ended).mean()),
    )


def _median(values: Sequence[float]) -> float:
    """Return the median; of an even number the higher of the two in the middle.

    So the median of finite and infinite values is one of them; NaN if one is NaN.
    """
    unknown = any(map(math.isnan, values))
    return math.nan if unknown else sorted(values)[len(values) // 2]


def expert_rows(arms: Sequence[Arm], episodes: int) -> list[Row]:
    """Return the evaluation of the expert as rows of a table of results.

    All teams that learn are played by the expert; the others have their opponents. The episodes are
    those in which a run with the seed of the arm is evaluated.

    Args:
        arms: The arms; the first one counts in which the expert has the senses and the control rate
            that it needs.
        episodes: Number of episodes; 0 plays none.

    Returns:
        A row for each team; none if the task has no expert or an opponent is another run.
    """
    for arm in arms if episodes else ():
        if has_expert(arm.cfg.task.name) and not arm.cfg.frozen:
            rows = _rows_of(arm, episodes)
            if rows:
                return rows
    return []


def _rows_of(arm: Arm, episodes: int) -> list[Row]:
    """Return the rows of one arm; none if its players lack what the expert needs."""
    cfg, seed = arm.cfg, evaluation_seed(arm.cfg.seed)
    expert = find_expert(cfg.task.name)
    with closing(VecaEnv(cfg.game, min(episodes, cfg.eval.worlds), seed)) as env:
        game = env.games[0]
        if any(missing_needs(expert, player, game.world.clock) for player in game.actors):
            return []
        scores = evaluate(env, ExpertPolicy(env), episodes, seed, Exploration.deterministic)
    head = {"arm": arm.name, "seed": str(cfg.seed), "state": "finished", "frames": "0"}
    return [
        head | {name: _cell(value) for name, value in row.items()}
        for row in score_rows("expert", scores)
    ]


def _cell(value: float | int | str) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
