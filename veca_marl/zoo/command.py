"""Policies that have learnt already: ``python -m veca_marl.zoo list``, ``... add run=runs/...``.

``list`` prints the policies with their returns and the words of their runs. ``add`` makes a file of
a run's latest checkpoint: parameters in half precision (safetensors), configuration and provenance,
at most 2 MB; before that it is played in the 100 frozen episodes of its task, as it is stored and
with the default parameters of the task.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from omegaconf import MISSING

from veca_marl.algos.checkpoints import CheckpointError, checkpoints_in, read_checkpoint
from veca_marl.algos.files import WriteError
from veca_marl.algos.policy_files import write_policy
from veca_marl.config import ConfigError, compose
from veca_marl.config.command_line import CommandLine, check_folder
from veca_marl.envs.core.benchmark import parameters
from veca_marl.envs.core.task import TaskCfg
from veca_marl.evaluate import BENCHMARK, EvaluateOptions, departures, evaluate_run, lines, summary
from veca_marl.policy_paths import SUFFIX, ZOO
from veca_marl.registry import unknown
from veca_marl.runs.run_folder import open_run, stored_configuration
from veca_marl.stored_files import read_json, read_yaml
from veca_marl.zoo.entries import Entry, entries

_ERRORS = (CheckpointError, WriteError)
_POLICIES = Path(__file__).parent / "policies"
_NAME = re.compile(r"\w[\w.-]{0,99}")


@dataclass
class ListOptions:
    """There are none."""


@dataclass
class AddOptions:
    """Options of ``add``.

    Attributes:
        run: Folder of a run (its latest checkpoint is used), or a checkpoint in it.
        name: Name of the entry; None is that of the task.
        to: Folder of the file; None is that of this package.
        episodes: ``benchmark`` for the frozen episodes of the task, or a number of others.
    """

    run: str = MISSING
    name: str | None = None
    to: str | None = None
    episodes: int | str = BENCHMARK

    def __post_init__(self) -> None:
        EvaluateOptions(episodes=self.episodes)
        if self.name is not None and not _NAME.fullmatch(self.name):
            raise ValueError(f"name={self.name} must be letters, digits, '_', '-' and '.' only")


def add(options: AddOptions, overrides: Sequence[str] = ()) -> Path:
    """Make a file of a run's policy, evaluate it and store the result in it.

    Args:
        options: The run, and the name of the file.
        overrides: Changes of the configuration for the evaluation.

    Returns:
        The file.

    Raises:
        CheckpointError: If there is no checkpoint, or it is too large.
        ConfigError: If there is no run, its game is not that of the frozen episodes, or there is
            an entry of the name.
    """
    checkpoint = _checkpoint(Path(options.run))
    folder = open_run(checkpoint.parent.parent, "run=")
    content = read_checkpoint(checkpoint, torch.device("cpu"))
    path = _new_entry(options, str(content["identity"]["task"]))
    provenance = read_json(folder.provenance)
    about: dict[str, Any] = {
        "config": read_yaml(folder.config),
        "bodies": provenance.get("bodies", {}),
        "provenance": {
            key: provenance[key]
            for key in ("overrides", "commit", "python", "packages")
            if key in provenance
        },
        "frames": _frames(checkpoint, content),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".") as draft:
        stored = Path(draft, path.name)
        write_policy(stored, content, about)  # played as it is stored: rounding could change it
        if options.episodes == BENCHMARK:
            cfg = stored_configuration(stored, overrides, "run=")
            overrides = [*default_task(cfg.task), *overrides]
        evaluated = evaluate_run(
            EvaluateOptions(run=str(stored), episodes=options.episodes), overrides
        )
    about["evaluation"] = _plain(summary(evaluated.table))
    if evaluated.benchmark is not None:
        about["benchmark"] = {
            "version": evaluated.benchmark.version,
            "game": departures(evaluated.game),
        }
    write_policy(path, content, about)
    return path


def _new_entry(options: AddOptions, task: str) -> Path:
    """Return the path of the file; what a stored checkpoint says of its task is no path."""
    name = options.name or task
    if not _NAME.fullmatch(name):
        raise ConfigError(f"run={options.run} is of a task {task!r:.80}: choose a name=")
    path = check_folder(options.to or _POLICIES, "to") / f"{name}{SUFFIX}"
    if path.exists():
        raise ConfigError(f"{path} exists: remove it first, or choose another name=")
    return path


def default_task(task: TaskCfg) -> list[str]:
    """Return the overrides that give a task its own defaults, those of the frozen episodes.

    A run may have learnt from other weights, or in shorter episodes.
    """
    own, default = parameters(task), parameters(compose([f"+task={task.name}"]).task)
    return [
        f"task.{name}={_text(value)}" for name, value in default.items() if own.get(name) != value
    ]


def _text(value: Any) -> str:
    """Return a plain value in the grammar of overrides."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{key}:{_text(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(map(_text, value)) + "]"
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _checkpoint(path: Path) -> Path:
    if path.is_file():
        return path
    found = checkpoints_in(path / "checkpoints")
    if not found:
        raise CheckpointError(f"run={path} is neither a checkpoint nor a run with one")
    return found[-1]


def _frames(checkpoint: Path, content: dict[str, Any]) -> int:
    """Return after how many frames a checkpoint was written."""
    progress = content["state"].get("progress")
    if isinstance(progress, dict) and isinstance(progress.get("frames"), int):
        return int(progress["frames"])
    digits = checkpoint.stem.rpartition("_")[2]
    return int(digits) if digits.isdecimal() else 0


def _plain(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        {key: list(value) if isinstance(value, tuple) else value for key, value in row.items()}
        for row in rows
    ]


def table(found: Sequence[Entry]) -> list[str]:
    """Return the entries as an aligned table, a row for each team that has learnt."""
    rows: list[dict[str, object]] = []
    for entry in found:
        own = [row for row in entry.evaluation if row.get("player") == "policy"]
        random = {r["team"]: r for r in entry.evaluation if r.get("player") == "random"}
        for row in own:
            other = random.get(row["team"], {})
            rows.append(
                {
                    "policy": f"{ZOO}{entry.name}",
                    "task": entry.task,
                    "team": row["team"],
                    "algorithm": entry.algorithm.get(str(row["team"]), "-"),
                    "frames": entry.frames,
                    "episodes": f"{row['episodes']}{' frozen' if entry.is_frozen else ''}",
                    "return": row["return"],
                    "random": other.get("return", "-"),
                    "solved": row.get("solved", "-"),
                    "bytes": entry.size,
                    "learnt by": " ".join(map(str, entry.provenance.get("overrides", ()))),
                }
            )
    return lines(rows) if rows else ["the zoo has no policies yet"]


def _list(_: ListOptions, overrides: list[str]) -> None:
    if overrides:
        raise ConfigError(f"list takes no {overrides[0]}")
    print(*table(entries()), sep="\n")


def _add(options: AddOptions, overrides: list[str]) -> None:
    torch.set_num_threads(1)
    path = add(options, overrides)
    print(f"{path}: {path.stat().st_size} bytes")


_ACTIONS = ["add", "list"]


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    given = list(sys.argv[1:] if words is None else words)
    action, rest = (given[0], given[1:]) if given else ("list", [])
    if action == "add":
        named = [f"run={w}" if "=" not in w and not w.startswith("-") else w for w in rest]
        line = CommandLine("zoo add", AddOptions, str(__doc__), _ERRORS, outputs=("name", "to"))
        return line.run(_add, named)
    if action == "list" or action.startswith("-"):
        rest = rest if action == "list" else given
        return CommandLine("zoo list", ListOptions, str(__doc__), _ERRORS).run(_list, rest)
    sys.stderr.write(f"error: {unknown('action', action, _ACTIONS)}\n")
    return 2
