"""Write the frozen episodes of tasks, ``veca_marl/data/benchmark/<task>.json``.

``python -m tools.make_benchmark`` writes those of all tasks, with names those of some. A file
that is current stays as it is; one that is not gets the next version.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from veca_marl.config import compose
from veca_marl.envs.core.benchmark import (
    EPISODES,
    SEED,
    Benchmark,
    find_benchmark,
    parameters,
    read_starts,
    to_text,
)
from veca_marl.envs.core.task import TASKS

FOLDER = Path(__file__).resolve().parent.parent / "veca_marl" / "data" / "benchmark"


def current(task: str) -> Benchmark:
    """Return the frozen episodes that the present code and presets give, as version 1."""
    game = compose([f"+task={task}"]).game
    starts = read_starts(game, SEED, range(EPISODES))
    return Benchmark(task, 1, SEED, parameters(game.task), tuple(starts))


def write(task: str) -> str:
    """Write the file of one task unless it is current; return what was done."""
    new, file = current(task), FOLDER / f"{task}.json"
    if file.exists():
        stored = find_benchmark(task)
        if replace(new, version=stored.version) == stored:
            return f"version {stored.version} is current"
        new = replace(new, version=stored.version + 1)
    file.write_text(to_text(new), encoding="utf-8")
    return f"wrote version {new.version}"


def main() -> None:
    """Write the files of the tasks that are named, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", metavar="TASK", help="all if none is named")
    names = parser.parse_args().tasks or sorted(TASKS)
    FOLDER.mkdir(exist_ok=True)
    for name in names:
        print(f"{name}: {write(name)}", flush=True)


if __name__ == "__main__":
    main()
