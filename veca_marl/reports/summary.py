"""The numbers of each arm: its curve over training and its final score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from veca_marl.reports.scores import Run, final_scores, random_scores
from veca_marl.reports.statistics import Interval, bootstrap_interval, interquartile_mean

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
