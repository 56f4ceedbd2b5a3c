"""The command: plays the episodes that are missing and writes the table."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tools.experts_table.episode_file import EpisodeFile, StaleEpisodesError, replay
from tools.experts_table.play import Job, Played, digest, game_cfg, play_all
from tools.experts_table.table import markdown
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.config import ConfigError, one_line, prepare
from veca_marl.config.command_line import CommandLine, check_folder
from veca_marl.envs.core.benchmark import EPISODES, Benchmark, find_benchmark, has_benchmark
from veca_marl.envs.core.expert import has_expert
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.core.task import TASKS
from veca_marl.processes.supervision import WorkerError
from veca_marl.runs.lock import locked
from veca_marl.runs.run_folder import checkout_commit


@dataclass
class TableOptions:
    """What is played, and where the results are kept.

    Attributes:
        to: Folder of the results: a file of episodes for each task, and the table. Episodes that
            are in it are not played again.
        tasks: Names of the tasks; ``[all]`` for all.
        episodes: How many of the frozen episodes of each task are played by each policy, the first
            ones; 0 plays none and writes the table of the stored ones.
        processes: Processes that play at the same time.
        frozen: Whether the starts have to be the frozen ones. False plays the same seeds with
            another body, playground or parameter of the task, which gives other starts.
        replay: Stored episodes of each task and policy that are played once more and compared with
            what is stored; nothing else is played or written. 0 for none.
    """

    to: str = "runs/experts"
    tasks: list[str] = field(default_factory=lambda: ["all"])
    episodes: int = EPISODES
    processes: int = 1
    frozen: bool = True
    replay: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.episodes <= EPISODES:
            raise ValueError(f"episodes must be from 0 to {EPISODES}, got {self.episodes}")
        if self.processes < 1:
            raise ValueError(f"processes must be at least 1, got {self.processes}")
        if self.replay < 0:
            raise ValueError(f"replay must be 0 or more, got {self.replay}")
        if not self.tasks:
            raise ValueError("tasks must name a task; [all] is all")
        twice = sorted({name for name in self.tasks if self.tasks.count(name) > 1})
        if twice:
            raise ValueError(f"tasks={self.tasks} names {twice[0]!r} more than once")


DESCRIPTION = """
Let the expert and the random policy play the frozen episodes of every task, and write a table of
returns, success rates and speeds:

    python -m tools.experts_table to=runs/experts
    python -m tools.experts_table tasks=[DodgeCar,ObjectNav] episodes=20 processes=4

The players of other teams act at random (``opponent.TEAM=expert`` for others). Each episode is
stored when it ends: a second call with the same folder plays those that are missing. A file
``remarks.csv`` in it (columns task, policy, remark) adds remarks to rows of the table. Rows of
earlier commits stay; ``replay=5`` plays five of them for each task and policy once more and names
those that differ.
"""
TABLE, REMARKS = "table.md", "remarks.csv"
_REMARK_COLUMNS = ("task", "policy", "remark")


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    errors = (WriteError, WorkerError, StaleEpisodesError)
    return CommandLine("experts_table", TableOptions, DESCRIPTION, errors).run(run, words)


def run(options: TableOptions, overrides: list[str]) -> None:
    """Play the missing episodes, write the table and print it.

    Raises:
        ConfigError: If a choice is impossible, stored episodes are of another configuration, or
            another process plays for the same folder.
        StaleEpisodesError: See `replay`.
    """
    folder = check_folder(options.to, "to")
    if options.replay:
        print(_replay(options, folder, overrides))
        return
    with locked(folder):
        table = _play_missing(options, folder, overrides)
        write_atomically(folder / TABLE, table)
    print(table)


def _play_missing(options: TableOptions, folder: Path, overrides: list[str]) -> str:
    """Play the missing episodes; return the table of all stored ones."""
    try:
        prepare(overrides)  # loads plug-ins with tasks of their own
        remarks = _remarks(folder)
        jobs = list(_missing(options, folder, overrides))
        for number, (job, played) in enumerate(
            play_all(jobs, options.processes, checkout_commit() or ""), 1
        ):
            _file(folder, job.task).add(played)
            _report(f"{number}/{len(jobs)} {job.task} {played.policy} {job.episode}", played)
        return markdown(_stored(folder), remarks)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def _replay(options: TableOptions, folder: Path, overrides: list[str]) -> str:
    """Play stored episodes of the tasks once more; return what was found."""
    try:
        prepare(overrides)
        stored = {task: rows for task, rows in _stored(folder).items() if rows}
        asked = list(stored) if options.tasks == ["all"] else options.tasks
        without = [task for task in asked if task not in stored]
        if without or not stored:
            raise ValueError(f"to={options.to} has no episodes of {without or 'any task'}")
        stored = {task: stored[task] for task in asked}
        for task, rows in stored.items():
            _file(folder, task).check(rows, digest(game_cfg(task, overrides)), rows[0].version)
        return replay(stored, options.replay, overrides, options.processes)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error


def _missing(options: TableOptions, folder: Path, overrides: Sequence[str]) -> Iterator[Job]:
    """Return the episodes that are not stored, task by task."""
    for task in _tasks(options):
        cfg, file, version = game_cfg(task, overrides), _file(folder, task), 0
        if options.frozen:
            benchmark = _benchmark(task)
            benchmark.check_parameters(cfg.task)
            version = benchmark.version
        stored = file.read()
        file.check(stored, digest(cfg), version)
        done = {(one.policy, one.episode) for one in stored}
        policies = [Script.expert, Script.random] if has_expert(task) else [Script.random]
        yield from (
            Job(task, tuple(overrides), policy, number, options.frozen)
            for policy in policies
            for number in range(options.episodes)
            if (policy.value, number) not in done
        )


def _tasks(options: TableOptions) -> list[str]:
    """Return the tasks that are asked for; of all, those without frozen episodes are left out."""
    if options.tasks != ["all"]:
        return options.tasks
    left_out = [task for task in sorted(TASKS) if options.frozen and not has_benchmark(task)]
    if left_out:
        sys.stderr.write(f"left out, without frozen episodes: {', '.join(left_out)}\n")
    return sorted(set(TASKS) - set(left_out))


def _benchmark(task: str) -> Benchmark:
    try:
        return find_benchmark(task)
    except ValueError as error:
        raise ValueError(f"{error}; frozen=false plays other starts") from error


def _stored(folder: Path) -> dict[str, list[Played]]:
    files = {path.stem: EpisodeFile(path) for path in sorted(folder.glob("*.csv"))}
    return {task: file.read() for task, file in files.items() if task in TASKS}


def _file(folder: Path, task: str) -> EpisodeFile:
    return EpisodeFile(folder / f"{task}.csv")


def _remarks(folder: Path) -> dict[tuple[str, str], str]:
    path = folder / REMARKS
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = [name for name in _REMARK_COLUMNS if name not in (reader.fieldnames or ())]
        if missing:
            raise ValueError(f"{path} has no column {missing[0]!r}; it needs {_REMARK_COLUMNS}")
        return {(row["task"], row["policy"]): row["remark"] for row in reader}


def _report(label: str, played: Played) -> None:
    solved = "" if played.solved is None else f" solved {played.solved:g}"
    sys.stderr.write(f"{label}: return {played.score:.3f}{solved}, {played.steps} steps\n")
