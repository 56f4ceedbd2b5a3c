"""Whether the claims of an experiment hold.

A claim about interquartile means is judged by the 95 % bootstrap interval of a difference: that of
two arms, of an arm and a baseline, or of an arm and a number.

- ``ARM > OTHER`` holds if the interval lies above 0, does not hold if it lies below 0, and is
  undecided if it contains 0.
- ``ARM > FACTOR x OTHER`` is judged in the same way, by the difference of the one to a multiple of
  the other.
- ``ARM = OTHER +- MARGIN`` holds if the interval lies within the margin, does not hold if it lies
  outside, and is undecided if it contains an end of the margin.
- ``N runs of ARM > NUMBER`` counts runs: it holds with at least N above the number, does not hold
  if the missing runs could not make it hold, and is undecided otherwise.
- ``ARM faster than OTHER`` holds if the interval of the probability that a run of the one reaches
  the threshold in fewer frames than a run of the other lies above 1/2, and does not hold if it lies
  below. Runs are compared up to the frames that all of them have; it is undecided if they were
  evaluated at different frames.

Claims about intervals need at least `MIN_RUNS` ended runs of each arm and are undecided with fewer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from veca_marl.config.experiment import (
    Above,
    AboveNumber,
    AboveTimes,
    Claim,
    Equal,
    Faster,
    RunsAbove,
)
from veca_marl.reports.scores import ExpertScore, Run, final_scores, frames_to, random_scores
from veca_marl.reports.statistics import (
    Interval,
    Scores,
    bootstrap_interval,
    difference,
    interquartile_mean,
    interval_of_difference,
    probability_of_improvement,
)

MIN_RUNS = 3
_SEED = 0


class Verdict(Enum):
    """What the runs say about a claim."""

    holds = "holds"
    does_not_hold = "does not hold"
    undecided = "undecided"


@dataclass(frozen=True)
class Judgement:
    """A verdict and the numbers that it follows from."""

    verdict: Verdict
    reason: str


@dataclass(frozen=True)
class Evidence:
    """What a claim is judged by.

    Attributes:
        runs: Runs of each arm that were evaluated.
        planned: Number of runs of each arm.
        expert: Score of the expert; None if it was not measured.
        threshold: The score to reach; None if the experiment has none.
    """

    runs: Mapping[str, Sequence[Run]]
    planned: int
    expert: ExpertScore | None = None
    threshold: float | None = None

    def final(self, arm: str) -> Scores:
        """Return the final scores of the ended runs of an arm, ``(runs, 1)``."""
        return final_scores(self.runs.get(arm, ()))


def judge(claim: Claim, evidence: Evidence) -> Judgement:
    """Return whether a claim holds, see the module."""
    match claim:
        case RunsAbove():
            return _judge_count(claim, evidence)
        case Faster():
            return _judge_faster(claim, evidence)
        case Equal(arm, other, margin):
            return _judge_equal(evidence.final(arm), evidence.final(other), margin)
        case AboveNumber(arm, number):
            return _judge_above(evidence.final(arm), _constant(number), f"{number:g}")
        case AboveTimes(arm, factor, other):
            return _judge_above(evidence.final(arm), factor * evidence.final(other))
        case Above():
            return _judge_order(claim, evidence)


def _judge_order(claim: Above, evidence: Evidence) -> Judgement:
    """Judge a claim about an arm and another arm, or one of the baselines."""
    one = evidence.final(claim.arm)
    if claim.other == "random":
        return _judge_above(one, random_scores(evidence.runs.get(claim.arm, ())))
    if claim.other != "expert":
        return _judge_above(one, evidence.final(claim.other))
    return _judge_above_expert(one, evidence.expert)


def overall(judgements: Sequence[Judgement]) -> Verdict:
    """Return the verdict on all claims together: each has to hold."""
    verdicts = {judgement.verdict for judgement in judgements}
    if Verdict.does_not_hold in verdicts:
        return Verdict.does_not_hold
    if verdicts == {Verdict.holds}:
        return Verdict.holds
    return Verdict.undecided


def _constant(number: float) -> Scores:
    return np.full((MIN_RUNS, 1), number)


def _judge_above(one: Scores, other: Scores, number: str | None = None) -> Judgement:
    """Judge whether `one` is above `other`; a `number` names a score without spread."""
    if (few := _too_few(one, *([other] if number is None else []))) is not None:
        return few
    interval = _difference_interval(one, other)
    if number is None:
        reason = f"{_difference_text(one, other, interval)}, {_improvement_text(one, other)}"
    else:
        low, high = bootstrap_interval(interquartile_mean, [one], _rng())
        reason = f"{interquartile_mean(one):.2f} [{low:.2f}, {high:.2f}] against {number}"
    reason = f"{reason}, {_count_text(one, other, number)}"
    if interval[0] > 0:
        return Judgement(Verdict.holds, reason)
    return Judgement(Verdict.does_not_hold if interval[1] < 0 else Verdict.undecided, reason)


def _judge_above_expert(one: Scores, expert: ExpertScore | None) -> Judgement:
    """Judge whether an arm is above the expert, whose score is a mean over episodes."""
    if (few := _too_few(one)) is not None:
        return few
    if expert is None:
        return Judgement(Verdict.undecided, "the expert was not measured")
    if math.isnan(expert.interval[0]):
        return Judgement(
            Verdict.undecided, "the expert has no interval: tables have one of the return alone"
        )
    score = float(interquartile_mean(one))
    interval = bootstrap_interval(interquartile_mean, [one], _rng())
    low, high = interval_of_difference(score, interval, expert.score, expert.interval)
    reason = (
        f"difference {score - expert.score:.2f} [{low:.2f}, {high:.2f}] to the expert, "
        f"{len(one)} runs"
    )
    if low > 0:
        return Judgement(Verdict.holds, reason)
    return Judgement(Verdict.does_not_hold if high < 0 else Verdict.undecided, reason)


def _judge_equal(one: Scores, other: Scores, margin: float) -> Judgement:
    if (few := _too_few(one, other)) is not None:
        return few
    interval = _difference_interval(one, other)
    reason = f"{_difference_text(one, other, interval)}, {_count_text(one, other)}"
    if -margin <= interval[0] and interval[1] <= margin:
        return Judgement(Verdict.holds, reason)
    outside = interval[0] > margin or interval[1] < -margin
    return Judgement(Verdict.does_not_hold if outside else Verdict.undecided, reason)


def _judge_count(claim: RunsAbove, evidence: Evidence) -> Judgement:
    scores = evidence.final(claim.arm)
    above = int((scores > claim.number).sum())
    missing = max(evidence.planned - len(scores), 0)
    reason = f"{above} of {len(scores)} ended runs are above {claim.number:g}, {missing} missing"
    if above >= claim.runs:
        return Judgement(Verdict.holds, reason)
    impossible = above + missing < claim.runs
    return Judgement(Verdict.does_not_hold if impossible else Verdict.undecided, reason)


def _judge_faster(claim: Faster, evidence: Evidence) -> Judgement:
    if evidence.threshold is None:
        return Judgement(Verdict.undecided, "the experiment has no threshold")
    arms = [
        [run for run in evidence.runs.get(name, ()) if run.ended]
        for name in (claim.arm, claim.other)
    ]
    if (few := _too_few(*map(final_scores, arms))) is not None:
        return few
    last = min(run.final.frames for runs in arms for run in runs)
    arms = [[run.until(last) for run in runs] for runs in arms]
    if len({tuple(p.frames for p in run.points) for runs in arms for run in runs}) > 1:
        return Judgement(Verdict.undecided, "the runs were evaluated at different frames")
    one, other = (frames_to(evidence.threshold, runs) for runs in arms)
    low, high = bootstrap_interval(probability_of_improvement, [-one, -other], _rng())
    reason = (
        f"probability of fewer frames to {evidence.threshold:g} "
        f"{probability_of_improvement(-one, -other):.2f} [{low:.2f}, {high:.2f}] "
        f"within {last}, {_count_text(one, other)}"
    )
    if low > 0.5:
        return Judgement(Verdict.holds, reason)
    return Judgement(Verdict.does_not_hold if high < 0.5 else Verdict.undecided, reason)


def _too_few(*arms: Scores) -> Judgement | None:
    counts = [len(scores) for scores in arms]
    if min(counts) >= MIN_RUNS:
        return None
    runs = " and ".join(map(str, counts))
    return Judgement(Verdict.undecided, f"{runs} ended runs; {MIN_RUNS} of an arm are needed")


def _difference_interval(one: Scores, other: Scores) -> Interval:
    return bootstrap_interval(difference, [one, other], _rng())


def _difference_text(one: Scores, other: Scores, interval: Interval) -> str:
    low, high = interval
    return f"difference {difference(one, other):.2f} [{low:.2f}, {high:.2f}]"


def _improvement_text(one: Scores, other: Scores) -> str:
    low, high = bootstrap_interval(probability_of_improvement, [one, other], _rng())
    probability = probability_of_improvement(one, other)
    return f"probability of improvement {probability:.2f} [{low:.2f}, {high:.2f}]"


def _count_text(one: Scores, other: Scores, number: str | None = None) -> str:
    return f"{len(one)} runs" if number else f"{len(one)} and {len(other)} runs"


def _rng() -> np.random.Generator:
    """Return a generator; each interval has its own, so that it does not depend on the others."""
    return np.random.default_rng(_SEED)
