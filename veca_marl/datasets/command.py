"""Data sets of what the senses perceive, and baselines: ``python -m veca_marl.datasets``.

    python -m veca_marl.datasets make +dataset=sound_localisation n=80000 seed=0
    python -m veca_marl.datasets show +dataset=sound_localisation verify=true
    python -m veca_marl.datasets train +dataset=sound_localisation

``make`` continues what a killed command has left. Each command lists its options: ``make --help``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.config import ConfigError
from veca_marl.config.command_line import (
    VERSION,
    CommandLine,
    check_file,
    check_folder,
    print_version,
)
from veca_marl.datasets.api import default_folder, make_with_card
from veca_marl.datasets.baselines.catalogue import find_baseline
from veca_marl.datasets.baselines.training import TrainOptions, as_json, lines, run_baseline
from veca_marl.datasets.configuration import DatasetConfig, compose_dataset
from veca_marl.datasets.dataset import DATASETS, NoSceneError
from veca_marl.datasets.storage import DatasetError, load
from veca_marl.processes.cores import usable_cores
from veca_marl.processes.supervision import WorkerError
from veca_marl.registry import unknown

_ERRORS = (DatasetError, NoSceneError, WriteError, WorkerError)


@dataclass
class MakeOptions:
    """Options of ``make``.

    Attributes:
        n: Number of samples.
        seed: Seed of all samples.
        out: Folder of the data set; None is ``datasets/NAME``.
        processes: Number of processes; None is one for each core. The bytes do not depend on it.
        progress: A progress bar.
    """

    n: int = 80_000
    seed: int = 0
    out: str | None = None
    processes: int | None = None
    progress: bool = True

    def __post_init__(self) -> None:
        if self.n < 1:
            raise ValueError(f"n must be at least 1, got {self.n}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if self.processes is not None and self.processes < 1:
            raise ValueError(f"processes must be at least 1, got {self.processes}")


@dataclass
class ShowOptions:
    """Options of ``show``.

    Attributes:
        data: Folder of the data set; None is ``datasets/NAME``.
        verify: Whether to read all of it and compare it with its checksums.
    """

    data: str | None = None
    verify: bool = False


def run_make(options: MakeOptions, overrides: list[str]) -> None:
    """Make a data set and its card."""
    folder = None if options.out is None else check_folder(options.out, "out")
    processes = options.processes or usable_cores()
    numbers = options.n, folder, options.seed, processes, options.progress
    stored = make_with_card(overrides, *numbers).stored
    print(f"{stored.folder}: {len(stored)} samples, checksum {stored.card['checksum'][:16]}")


def run_show(options: ShowOptions, overrides: list[str]) -> None:
    """Print what a data set contains."""
    folder = _given_folder(options.data, overrides)
    stored = load(folder, options.verify)
    plan = stored.plan
    print(f"{plan.name}: {stored.card['description']}")
    print(f"{plan.n} samples, seed {plan.seed}, {plan.n_bytes / 1e6:,.1f} MB, in {folder}")
    for name, field in plan.fields.items():
        shape = "x".join(map(str, field.shape)) or "scalar"
        print(
            f"  {name}: {field.dtype} {shape}, {field.role.value}: {field.meaning} [{field.unit}]"
        )
    if options.verify:
        print("all checksums agree")


def run_train(options: TrainOptions, overrides: list[str]) -> None:
    """Train the baseline of a data set, print its scores and write the JSON file."""
    file = None if options.json is None else check_file(options.json, "json")
    stored = load(_given_folder(options.data, overrides))
    baseline = find_baseline(stored)
    scores = run_baseline(stored, options)
    print(*lines(stored, baseline, scores), sep="\n")
    if file is not None:
        words = [
            f"+dataset={stored.plan.name}", f"epochs={options.epochs}", f"runs={options.runs}",
            f"seed={options.seed}",
        ]  # fmt: skip
        write_atomically(file, as_json(stored, options, scores, words))


def _given_folder(data: str | None, overrides: list[str]) -> Path:
    """Return the folder that ``data=`` names, or that of ``+dataset=NAME``."""
    if data is not None:
        return Path(data)
    return default_folder(compose_dataset(overrides).dataset.name)


COMMANDS: dict[str, tuple[CommandLine[Any], Callable[[Any, list[str]], None]]] = {
    "make": (
        CommandLine(
            "datasets make",
            MakeOptions,
            "Make a data set: python -m veca_marl.datasets make +dataset=NAME n=80000 seed=0.\n\n"
            f"NAME is one of {', '.join(sorted(DATASETS))}.",
            _ERRORS,
            outputs=("out",),
            root=DatasetConfig,
        ),
        run_make,
    ),
    "show": (
        CommandLine(
            "datasets show",
            ShowOptions,
            "Print what a data set contains: python -m veca_marl.datasets show +dataset=NAME.",
            _ERRORS,
            root=DatasetConfig,
        ),
        run_show,
    ),
    "train": (
        CommandLine(
            "datasets train",
            TrainOptions,
            "Train the baseline of a data set: python -m veca_marl.datasets train +dataset=NAME.",
            _ERRORS,
            outputs=("json",),
            root=DatasetConfig,
        ),
        run_train,
    ),
}


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    words = list(sys.argv[1:] if words is None else words)
    if words and words[0] in COMMANDS:
        line, call = COMMANDS[words[0]]
        return line.run(call, words[1:])
    if VERSION in words:
        print_version()
        return 0
    if not words or words[0] in ("-h", "--help"):
        print(str(__doc__).strip())
        print(f"\nData sets: {', '.join(sorted(DATASETS))}.")
        return 0
    error = ConfigError(unknown("command", words[0], list(COMMANDS)))
    sys.stderr.write(f"error: {error}\n")
    return 2


if __name__ == "__main__":
    sys.exit(main())
