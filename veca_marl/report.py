"""Report on an experiment: ``python -m veca_marl.report +experiment=audio_ablation``.

Gathers the runs of ``python -m veca_marl.train -m +experiment=...`` and writes ``report.md`` (the
verdict on each claim, a table of the arms, a table of the runs, what is missing), ``curves.png``
(interquartile means over seeds with bootstrap intervals) and ``results.csv`` (all evaluations).
Overrides that the runs were started with are repeated: ``total_frames=1e5``.

A sweep without an experiment is reported with the words that started it; its arms are the
combinations of the values that it lists: ``python -m veca_marl.report -m +task=KickTheBall
senses/audio=hrtf,mono seed=0,1,2``.
"""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.config import ConfigError
from veca_marl.config.command_line import CommandLine, check_folder
from veca_marl.config.experiment import ExperimentCfg, parse_claim
from veca_marl.config.overrides import parse
from veca_marl.override_text import normalised
from veca_marl.reports.arms import Arm, compose_arms, compose_sweep
from veca_marl.reports.figure import check_plotting, draw
from veca_marl.reports.gather import (
    Found,
    found_in,
    gather,
    planned_rows,
    read_rows,
    write_rows,
)
from veca_marl.reports.page import Report, page, run_remarks
from veca_marl.reports.scores import expert_rows, expert_score, runs_of, summarise, team_of
from veca_marl.reports.verdict import Evidence, judge
from veca_marl.stored_files import Row
from veca_marl.sweeps.names import is_sweep, key_of

FIGURE = "curves.png"


@dataclass
class ReportOptions:
    """Options of the command.

    Attributes:
        runs: Folder of the runs; None is ``runs/<name of the experiment>``.
        to: Folder that the files are written to; None is that of the runs.
        results: A ``results.csv`` to read in place of runs; its folder is the default of `to`.
        expert_episodes: Episodes that the expert plays as a baseline; 0 leaves it out.
    """

    runs: str | None = None
    to: str | None = None
    results: str | None = None
    expert_episodes: int = 32

    def __post_init__(self) -> None:
        if self.runs is not None and self.results is not None:
            raise ValueError("runs and results: choose one of both")
        if self.expert_episodes < 0:
            raise ValueError(f"expert_episodes must be 0 or more, got {self.expert_episodes}")


def make_report(options: ReportOptions, arms: Sequence[Arm], command: str) -> tuple[Report, Path]:
    """Write the files of a report; return it and their folder.

    Args:
        options: Where the runs are.
        arms: All arms of the experiment.
        command: The command that runs them.

    Raises:
        ConfigError: If nothing has been evaluated, or a path of the options is impossible.
        PlotError: If matplotlib is missing.
        ValueError: If a file is not what it should be, or the team or metric does not exist.
        OSError: If a file cannot be read, or the figure cannot be written.
        WriteError: If another file cannot be written.
    """
    check_plotting()
    if options.to is not None:
        check_folder(options.to, "to")
    if options.results is not None and not Path(options.results).is_file():
        raise ConfigError(f"results={options.results} is no file")
    experiment = arms[0].cfg.experiment
    found, rows, folder = _read(options, arms, str(experiment.name))
    report = _report(arms, command, rows, found)
    folder.mkdir(parents=True, exist_ok=True)
    # all rows that were read: a report on fewer seeds takes none away from the table
    write_rows(folder / "results.csv", rows)
    by_arm = {arm.name: [run for run in report.runs if run.arm == arm.name] for arm in arms}
    drawn = {name: runs for name, runs in by_arm.items() if runs}
    title = f"{arms[0].cfg.task.name}: {experiment.name}"
    draw(folder / FIGURE, drawn, report.baselines, title, f"{experiment.metric} of an episode")
    write_atomically(folder / "report.md", page(report))
    return report, folder


def _read(
    options: ReportOptions, arms: Sequence[Arm], name: str
) -> tuple[list[Found], list[Row], Path]:
    """Return the state of each run, the table of results and the folder of the report."""
    seeds = arms[0].cfg.experiment.seeds
    if options.results is not None:
        path = Path(options.results)
        rows = read_rows(path)
        found = found_in(rows, {arm.name: arm.budget for arm in arms}, seeds)
        return found, rows, Path(options.to or path.parent)
    runs = Path(options.runs or f"runs/{name}")
    asked = {arm.name: arm.plain for arm in arms}
    found, rows = gather(runs, asked, seeds)
    if rows:
        rows += expert_rows(arms, options.expert_episodes)
    return found, rows, Path(options.to or runs)


def _report(
    arms: Sequence[Arm], command: str, rows: Sequence[Row], found: Sequence[Found]
) -> Report:
    experiment = arms[0].cfg.experiment
    rows, others = planned_rows(rows, experiment.arms, experiment.seeds)
    if not any(row["player"] == "policy" for row in rows):
        raise _nothing_evaluated(experiment, found)
    opponents = {team for arm in arms for team in arm.cfg.opponent}
    team = team_of(rows, experiment.team, opponents)
    runs = runs_of(rows, experiment.metric, team, {arm.name: arm.budget for arm in arms})
    if not runs:
        raise _nothing_evaluated(experiment, found)
    by_arm = {arm: [run for run in runs if run.arm == arm] for arm in experiment.arms}
    expert = expert_score(rows, experiment.metric, team)
    evidence = Evidence(by_arm, len(experiment.seeds), expert, experiment.threshold)
    random = [run.random for run in runs if not math.isnan(run.random)]
    return Report(
        experiment,
        command,
        team,
        [summarise(arm, own, experiment.threshold) for arm, own in by_arm.items()],
        runs,
        found,
        others,
        {text: judge(parse_claim(text, by_arm), evidence) for text in experiment.claims},
        {
            "random": float(np.mean(random)) if random else math.nan,
            "expert": math.nan if expert is None else expert.score,
        },
        sorted({run.commit for run in found if run.counts and run.commit}),
        FIGURE,
    )


def _nothing_evaluated(experiment: ExperimentCfg, found: Sequence[Found]) -> ConfigError:
    remarks = [f"{run.arm}, seed {run.seed}: {run.remark}" for run in found if run.remark]
    more = f"; and {len(remarks) - 3} more" if len(remarks) > 3 else ""
    named = "; ".join(remarks[:3])
    return ConfigError(f"no run of {experiment.name} has been evaluated: {named}{more}")


def run(options: ReportOptions, overrides: list[str]) -> None:
    """Write the report; print the verdict, what is missing, and where the files are."""
    command = shlex.join(["python", "-m", "veca_marl.train", "-m", *overrides])
    arms = compose_sweep(overrides) if _is_plain_sweep(overrides) else compose_arms(overrides)
    report, folder = make_report(options, arms, command)
    for text, judgement in report.judgements.items():
        print(f"{text}: {judgement.verdict.value}: {judgement.reason}")
    ends = [f"verdict: {report.verdict}", f"report: {folder / 'report.md'}"]
    print(*run_remarks(report), *ends, sep="\n")


def _is_plain_sweep(overrides: Sequence[str]) -> bool:
    """Return whether overrides list values without an experiment that has arms.

    Raises:
        ConfigError: If one does not follow the grammar.
    """
    parse(normalised(overrides))
    return is_sweep(overrides) and "experiment" not in map(key_of, overrides)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    errors = (ValueError, OSError, WriteError)
    places = ("experiment", "runs", "results", "to")
    line = CommandLine(
        "report", ReportOptions, str(__doc__), errors, ("to",), places, _is_plain_sweep
    )
    return line.run(run, words)


if __name__ == "__main__":
    sys.exit(main())
