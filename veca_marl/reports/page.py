"""The report as Markdown: verdict, table of arms, table of runs, and what is missing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from veca_marl.config.experiment import Above, ExperimentCfg, Faster, parse_claim
from veca_marl.reports.gather import Found
from veca_marl.reports.scores import ArmSummary, Point, Run
from veca_marl.reports.statistics import false_order_rate, false_speed_rate
from veca_marl.reports.verdict import MIN_RUNS, Judgement, Verdict, overall

EPISODES_OF_FIGURES = 32
"""Evaluations with fewer episodes have intervals too wide for a figure."""


@dataclass(frozen=True)
class Report:
    """Everything that a report states.

    Attributes:
        experiment: The experiment.
        command: The command that runs it.
        team: The team that is compared.
        summaries: The numbers of each arm.
        runs: The runs that were evaluated.
        found: What there is of each planned run.
        others: Arm and seed of runs that the table of results has and the experiment has not.
        judgements: The verdict on each claim, by its text.
        baselines: Score of each policy that does not learn; NaN if it was not measured.
        commits: Commits that the runs were made with.
        figure: Name of the file with the curves.
    """

    experiment: ExperimentCfg
    command: str
    team: str
    summaries: Sequence[ArmSummary]
    runs: Sequence[Run]
    found: Sequence[Found]
    others: Sequence[tuple[str, int]]
    judgements: Mapping[str, Judgement]
    baselines: Mapping[str, float]
    commits: Sequence[str]
    figure: str

    @property
    def verdict(self) -> str:
        """The verdict on all claims in words, such as ``undecided: 3 seeds``."""
        if not self.judgements:
            return "no claim is stated as data"
        verdict = overall(list(self.judgements.values()))
        if verdict is not Verdict.undecided:
            return str(verdict.value)
        counts = sorted({summary.ended for summary in self.summaries})
        seeds = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        return f"{verdict.value}: {seeds} seeds"


def page(report: Report) -> str:
    """Return the Markdown text of a report."""
    experiment = report.experiment
    parts = [
        f"# Report: {experiment.name}",
        f"**Claim.** {experiment.claim or '(none in words)'}",
        f"**Verdict.** {report.verdict[0].upper()}{report.verdict[1:]}.",
        "\n".join(_verdict_lines(report.judgements)),
        _error_rate_text(report),
        f"![Learning curves of {experiment.name}]({report.figure})",
        _caption(report),
        "\n".join(_arm_table(report)),
        "\n".join(_baseline_lines(report.baselines)),
        "\n".join(_remark_lines(report)),
        "\n".join(_run_table(report)),
        f"Command: `{report.command}`",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _verdict_lines(judgements: Mapping[str, Judgement]) -> list[str]:
    return [
        f"- `{text}` {judgement.verdict.value}: {judgement.reason}"
        for text, judgement in judgements.items()
    ]


def _error_rate_text(report: Report) -> str:
    """Return how often claims about two arms with so few runs are decided although none differs."""
    order = _rates_text(false_order_rate, _compared_counts(report, Above))
    speed = _rates_text(false_speed_rate, _compared_counts(report, Faster))
    rates = [
        *([f"a claim `ARM > OTHER` would be decided in {order} of experiments"] if order else []),
        *([f"`ARM faster than OTHER` in at most {speed}"] if speed else []),
    ]
    if not rates:
        return ""
    decided = ", ".join(rates)
    start = "Of two arms with scores from one normal distribution"
    return f"{start}, {decided}, by a simulation."


def _rates_text(rate: Callable[[int, int], float], counts: Sequence[tuple[int, int]]) -> str:
    return ", ".join(f"{100.0 * rate(*n):.0f} % ({n[0]} and {n[1]} runs)" for n in counts)


def _compared_counts(report: Report, kind: type[Above | Faster]) -> list[tuple[int, int]]:
    """Return the numbers of ended runs of arms that are compared, where a verdict is possible."""
    ended = {summary.arm: summary.ended for summary in report.summaries}
    claims = [parse_claim(text, list(ended)) for text in report.judgements]
    counts = {
        (ended[claim.arm], ended[claim.other])
        for claim in claims
        if isinstance(claim, kind) and claim.other in ended
    }
    return sorted(pair for pair in counts if min(pair) >= MIN_RUNS)


def _caption(report: Report) -> str:
    return (
        f"Thick lines are interquartile means of `{report.experiment.metric}` of team "
        f"`{report.team}` over runs, areas and brackets 95 % stratified bootstrap intervals over "
        "runs (Agarwal et al. 2021), thin lines single runs. Intervals over few runs are too "
        "narrow: resampling cannot show values that no run has. Minutes are those of collection, "
        "learning and evaluation; core-minutes are processor time, of all processes together."
        f"{_unequal_text(report)}{_intermediate_text(report)}"
    )


def _unequal_text(report: Report) -> str:
    """Return a sentence on curves in which not all runs of an arm have all points."""
    lasts: dict[str, set[int]] = {}
    for run in report.runs:
        lasts.setdefault(run.arm, set()).add(run.final.frames)
    if all(len(frames) == 1 for frames in lasts.values()):
        return ""
    return (
        " Each point of a thick line is over the runs that were evaluated there: where a run has "
        "stopped earlier, the line may jump."
    )


def _intermediate_text(report: Report) -> str:
    """Return a sentence on evaluations of few episodes that curves and times rest on."""
    # those of a run that has not ended are all intermediate
    points = [point for run in report.runs for point in run.points[: -1 if run.ended else None]]
    fewest = _fewest_episodes(points)
    if fewest is None:
        return ""
    times = (
        ""
        if report.experiment.threshold is None
        else " and the frames and minutes to the threshold"
    )
    return (
        f" Before the final evaluations, the curves{times} rest on evaluations of as few as "
        f"{fewest} episodes; figures need at least {EPISODES_OF_FIGURES}."
    )


def _fewest_episodes(points: Iterable[Point]) -> int | None:
    """Return the least number of episodes; None if it suffices, or if none is stored."""
    fewest = min((point.episodes for point in points if point.episodes), default=None)
    return None if fewest is None or fewest >= EPISODES_OF_FIGURES else fewest


def _arm_table(report: Report) -> list[str]:
    threshold = report.experiment.threshold
    head = ["arm", "ended runs", "final score", "random policy"]
    rows = [
        [
            summary.arm,
            str(summary.ended),
            _interval(summary.score, *summary.interval),
            _number(summary.random, 2),
        ]
        for summary in report.summaries
    ]
    if threshold is not None:
        head += [f"runs at {threshold:g}", f"median frames to {threshold:g}"]
        head += ["median minutes", "median core-minutes"]
        for row, summary in zip(rows, report.summaries, strict=True):
            row += [
                f"{summary.reached} of {summary.ended}",
                _number(summary.frames, 0),
                _number(summary.minutes, 1),
                _number(summary.core_minutes, 1),
            ]
    return table(head, rows)


def _baseline_lines(baselines: Mapping[str, float]) -> list[str]:
    known = [f"{name} {score:.2f}" for name, score in baselines.items() if not math.isnan(score)]
    return [f"Policies that do not learn, as lines in the figure: {', '.join(known)}."]


def _remark_lines(report: Report) -> list[str]:
    """Return what a reader has to know about single runs and about all."""
    lines = [f"- {line}" for line in run_remarks(report)]
    ended = [run for run in report.runs if run.ended]
    short = [run for run in ended if 0 < run.final.episodes < EPISODES_OF_FIGURES]
    if short:
        fewest = min(run.final.episodes for run in short)
        equal = all(run.final.episodes == fewest for run in ended)
        which = f"{fewest} episodes" if equal else f"as few as {fewest} episodes ({_named(short)})"
        lines.append(f"- final evaluations of {which}; figures need at least {EPISODES_OF_FIGURES}")
    if len(report.commits) > 1:
        lines.append(f"- runs of several commits: {', '.join(report.commits)}")
    elif report.commits:
        lines.append(f"- commit {report.commits[0]}")
    return ["**Remarks**", "", *lines] if lines else []


def run_remarks(report: Report) -> list[str]:
    """Return a line for each remark on runs, of the experiment and of the table of results."""
    others: dict[str, list[str]] = {}
    for arm, seed in report.others:
        others.setdefault(arm, []).append(str(seed))
    lines = remarks(report.found)
    unmeasured = [run for run in report.runs if math.isnan(run.final.score)]
    if unmeasured:
        metric = report.experiment.metric
        lines.append(f"{_named(unmeasured)}: `{metric}` was not measured at the end; not counted")
    if others:
        named = "; ".join(_seeds(arm, seeds) for arm, seeds in others.items())
        lines.append(f"rows of {named} are not part of this experiment as configured; not counted")
    return lines


def _named(runs: Iterable[Run]) -> str:
    """Return the names of some runs: arms with their seeds."""
    seeds: dict[str, list[str]] = {}
    for run in runs:
        seeds.setdefault(run.arm, []).append(str(run.seed))
    return "; ".join(_seeds(arm, own) for arm, own in seeds.items())


def remarks(found: Sequence[Found]) -> list[str]:
    """Return a line for each remark, which names all runs that it is about."""
    seeds: dict[str, dict[str, list[str]]] = {}
    for run in found:
        if run.remark:
            seeds.setdefault(run.remark, {}).setdefault(run.arm, []).append(str(run.seed))
    return [
        f"{'; '.join(map(_seeds, *zip(*arms.items(), strict=True)))}: {remark}"
        for remark, arms in seeds.items()
    ]


def _seeds(arm: str, seeds: Sequence[str]) -> str:
    return f"{arm}, seed{'s' if len(seeds) > 1 else ''} {', '.join(seeds)}"


def _run_table(report: Report) -> list[str]:
    rows = [
        [
            run.arm,
            str(run.seed),
            "yes" if run.ended else "no",
            str(run.final.frames),
            f"{run.final.score:.2f}",
            _number(run.random, 2),
            _number(run.final.minutes, 1),
            _number(run.final.core_minutes, 1),
        ]
        for run in report.runs
    ]
    head = ["arm", "seed", "ended", "frames", "score", "random policy", "minutes", "core-minutes"]
    return table(head, rows)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(cells)} |" for cells in lines]


def _interval(score: float, low: float, high: float) -> str:
    if math.isnan(score):
        return "no ended run"
    if math.isnan(low):
        return f"{score:.2f} (one run: no interval)"
    return f"{score:.2f} [{low:.2f}, {high:.2f}]"


def _number(value: float, digits: int) -> str:
    if math.isnan(value):
        return ""
    return "not reached" if math.isinf(value) else f"{value:.{digits}f}"
