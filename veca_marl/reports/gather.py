"""Gathers the evaluations of all runs of an experiment into one table."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from veca_marl.algos.files import write_atomically
from veca_marl.reports.arms import FrameBudget
from veca_marl.runs.continuation import may_change
from veca_marl.stored_files import Columns, Row, StoredFileError, read_json, read_table
from veca_marl.sweeps.differences import differences, key_patterns
from veca_marl.sweeps.run_state import TABLES, RunState, StoredRun, read_run

_CONFIG_KEYS = ("task", "seed", "total_frames")  # of every version
_RESULTS = Columns(
    whole=("seed", "frames"),
    words=("arm", "player", "team"),
    may_be_whole=("episodes",),
    may_be_words=("state", "commit", "remark"),
)


class DamagedRunError(ValueError):
    """A file of a run cannot be read; the message names the file and the reason."""


def read_checked_run(folder: Path) -> tuple[StoredRun, str]:
    """Return the run in a folder, which may be missing, and the commit that it was made with.

    The commit is the version of the package where it was installed, and empty where no
    ``provenance.json`` was written.

    Raises:
        DamagedRunError: If a file that a report reads is damaged.
    """
    with _read_errors(folder / "config.yaml"):
        run = read_run(folder)
        if run.config is None:
            return run, ""
        _check_keys(run.config)
    for kind in TABLES:
        with _read_errors(folder / f"{kind}.csv"):
            run.rows(kind)
    path = folder / "provenance.json"
    with _read_errors(path):
        return run, _commit(path)


@contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Turn errors of reading a file into one sentence that names it, or another file beside it."""
    try:
        yield
    except (ValueError, OSError) as error:
        reason = " ".join(str(error).split())
        named = str(path.parent) in reason
        raise DamagedRunError(reason if named else f"{path}: {reason}") from error


def _check_keys(config: dict[str, Any]) -> None:
    # keys that are absent count as those of another version: a file that was cut off would pass
    absent = [key for key in _CONFIG_KEYS if key not in config]
    if absent:
        raise ValueError(f"no key {absent[0]!r}")


def _commit(path: Path) -> str:
    if not path.is_file():
        return ""
    stored = read_json(path)
    packages = stored.get("packages")
    version = packages.get("veca_marl") if isinstance(packages, dict) else None
    if not (commit := stored.get("commit") or version):
        raise ValueError("names neither a commit nor a version of veca_marl")
    return str(commit)


@dataclass(frozen=True)
class Found:
    """A run that an experiment asks for, and what there is of it.

    Attributes:
        arm: Its arm.
        seed: Its seed.
        folder: Where it is, or would be; None in a table of results.
        state: How far it has come; ``missing`` if a file is damaged.
        counts: Whether it has ended with the configuration and the frames of the experiment.
        remark: What a reader has to know; empty for a finished run.
        commit: Commit that it was made with, or version of the package; empty if not known.
    """

    arm: str
    seed: int
    folder: Path | None
    state: RunState
    counts: bool
    remark: str
    commit: str = ""


def run_folder(runs: Path, arm: str, seed: int) -> Path:
    """Return the folder of a run of an experiment whose runs lie in `runs`."""
    return runs / arm / f"seed_{seed}"


def gather(
    runs: Path,
    asked: Mapping[str, Mapping[str, Any]],
    seeds: Sequence[int],
) -> tuple[list[Found], list[Row]]:
    """Return what there is of each run, and the evaluations of those that fit.

    Runs with another configuration than that of the experiment, and damaged ones, are left out of
    the rows.

    Args:
        runs: Folder of the experiment's runs.
        asked: Configuration of each arm as plain data.
        seeds: Seeds of each arm.
    """
    found, rows = [], []
    for arm, config in asked.items():
        for seed in seeds:
            folder = run_folder(runs, arm, seed)
            status, own = _gather_run(folder, arm, {**config, "seed": seed})
            found.append(status)
            rows += own
    return found, rows


def _gather_run(folder: Path, arm: str, asked: Mapping[str, Any]) -> tuple[Found, list[Row]]:
    try:
        run, commit = read_checked_run(folder)
    except DamagedRunError as error:
        remark = f"not counted, damaged: {error}"
        return Found(arm, int(asked["seed"]), folder, RunState.missing, False, remark), []
    status, fits = _status(run, arm, asked)
    status = replace(status, commit=commit)
    return status, _rows(run, status) if fits else []


def _status(run: StoredRun, arm: str, asked: Mapping[str, Any]) -> tuple[Found, bool]:
    state = run.state(asked["total_frames"], asked["max_minutes"])
    base = (arm, int(asked["seed"]), run.folder, state)
    if run.config is None:
        return Found(*base, False, f"missing: no run in {run.folder}"), False
    differing = [d for d in differences(run.config, asked) if not may_change(d.key)]
    changed = [str(d) for d in differing if not d.of_version]
    if changed:
        return Found(*base, False, f"not counted: {'; '.join(changed)}"), False
    budget, evaluated = FrameBudget.of(asked), evaluated_frames(run.rows("evaluations"))
    remark = budget.remark(evaluated) or _remark(run, state, asked)
    others = key_patterns(d.key for d in differing)
    if others:
        remark = f"{remark}; stored by a version with other keys: {', '.join(others)}".lstrip("; ")
    counts = bool(evaluated) and budget.counts(state, evaluated)
    return Found(*base, counts, remark), True


def evaluated_frames(rows: Iterable[Mapping[str, str]]) -> list[int]:
    """Return the frames of training before each evaluation of the policy of a run."""
    return [int(row["frames"]) for row in rows if row["player"] == "policy"]


def _remark(run: StoredRun, state: RunState, asked: Mapping[str, Any]) -> str:
    if state in (RunState.finished, RunState.cut) and not run.rows("evaluations"):
        return "not counted: it has no evaluations.csv (csv is not in its log.logger)"
    if state is RunState.finished:
        return ""
    reached = f"{run.progress.frames} of {asked['total_frames']} frames"
    if state is RunState.cut:
        return f"cut by max_minutes={asked['max_minutes']} at {reached}"
    return f"unfinished: {reached}; shown, not counted"


def _rows(run: StoredRun, status: Found) -> list[Row]:
    """Return the evaluations of a run with its arm, its seed and the time until each."""
    spent = training_time(run.rows("metrics"))
    rows = []
    for row in run.rows("evaluations"):
        after = int(np.searchsorted(spent.frames, int(row["frames"]), side="right"))
        head = {"arm": status.arm, "seed": str(status.seed), "state": status.state.value}
        times = {"minutes": _cell(spent.minutes[after])}
        times["core_minutes"] = _cell(spent.core_minutes[after])
        rows.append({**head, **row, **times, "commit": status.commit, "remark": status.remark})
    return rows


def _cell(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.3f}"


@dataclass(frozen=True)
class TrainingTime:
    """Time of training until each of `n` batches.

    Entry ``k`` of the times belongs to the first ``k`` batches. They include collection, learning,
    and evaluations between batches.

    Attributes:
        frames: Frames of training after each batch, ``(n,)``.
        minutes: Elapsed minutes, ``(n + 1,)``; NaN without batches. The time between an
            interruption and its resumption is left out. Runs that were stored without the column
            ``between_s`` have minutes of collection and learning alone.
        core_minutes: Minutes of processor time of all processes, ``(n + 1,)``; NaN where they were
            not measured.
    """

    frames: Any
    minutes: Any
    core_minutes: Any


def training_time(metrics: Sequence[Mapping[str, str]]) -> TrainingTime:
    """Return the time of training, from the rows of ``metrics.csv``.

    Args:
        metrics: A row for each batch; empty if the logger of these rows was not chosen.
    """
    if not metrics:
        unknown = np.array([math.nan])
        return TrainingTime(np.array([], dtype=int), unknown, unknown)
    frames = np.array([int(row["frames"]) for row in metrics])
    rates = np.array([float(row["frames_per_s"]) for row in metrics])
    between = np.array([float(row.get("between_s") or 0.0) for row in metrics])
    processor = np.array([float(row.get("processor_s") or "nan") for row in metrics])
    seconds = np.diff(frames, prepend=0) / rates + between
    return TrainingTime(frames, _cumulative_minutes(seconds), _cumulative_minutes(processor))


def _cumulative_minutes(seconds: Any) -> Any:
    return np.concatenate([[0.0], np.cumsum(seconds) / 60.0])


def planned_rows(
    rows: Sequence[Row], arms: Iterable[str], seeds: Sequence[int]
) -> tuple[list[Row], list[tuple[str, int]]]:
    """Return the rows of an experiment, and arm and seed of each run that it does not have.

    The expert learns nothing: its rows belong to their arm, whatever their seed.

    Args:
        rows: A table of results, which may be that of another configuration of the experiment.
        arms: The arms.
        seeds: Seeds of each arm.
    """
    experts = {(arm, "expert") for arm in arms}
    runs = {(arm, seed) for arm, _ in experts for seed in seeds}
    planned, others = [], set()
    for row in rows:
        run = (row["arm"], int(row["seed"]))
        if run in runs or (row["arm"], row["player"]) in experts:
            planned.append(row)
        else:
            others.add(run)
    return planned, sorted(others)


def found_in(
    rows: Sequence[Row], budgets: Mapping[str, FrameBudget], seeds: Sequence[int]
) -> list[Found]:
    """Return what a table of results holds of each run of an experiment.

    Args:
        rows: The table, which `gather` made at an earlier time.
        budgets: Frames that the runs of each arm are asked to have.
        seeds: Seeds of each arm.
    """
    runs: dict[tuple[str, int], list[Row]] = {}
    for row in rows:
        if row["player"] != "expert":
            runs.setdefault((row["arm"], int(row["seed"])), []).append(row)
    return [
        _found_in(arm, seed, runs.get((arm, seed), ()), budget)
        for arm, budget in budgets.items()
        for seed in seeds
    ]


def _found_in(arm: str, seed: int, rows: Sequence[Row], budget: FrameBudget) -> Found:
    state = state_in(rows)
    evaluated = evaluated_frames(rows)
    counts = budget.counts(state, evaluated)
    remark = budget.remark(evaluated)
    if not remark and state is not RunState.finished:
        remark = f"{state.value} in the table of results"
    elif not remark and not counts:
        reached = f"{max(evaluated, default=0)} of {budget.frames} frames"
        remark = f"unfinished: {reached} in the table of results; shown, not counted"
    last = rows[-1] if rows else {}
    remark = remark or last.get("remark", "")
    return Found(arm, seed, None, state, counts, remark, last.get("commit", ""))


def state_in(rows: Sequence[Mapping[str, str]]) -> RunState:
    """Return the state that a table of results states for a run, from the rows of that run.

    Tables of early versions have no states: they hold finished runs only.
    """
    if not rows:
        return RunState.missing
    return RunState(rows[-1].get("state") or "finished")


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV; columns that a row lacks are empty.

    Raises:
        WriteError: If the file cannot be written; a former one is unchanged.
    """
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, text.getvalue())


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a file that `write_rows` wrote.

    Raises:
        StoredFileError: If a column that a report needs is missing, or a row is damaged.
    """
    rows = read_table(path, _RESULTS)
    states = [state.value for state in RunState]
    for number, row in enumerate(rows, start=1):
        if row.get("state") and row["state"] not in states:
            reason = f"row {number}: state {row['state'][:80]!r}; choices: {', '.join(states)}"
            raise StoredFileError(path, reason)
    return rows
