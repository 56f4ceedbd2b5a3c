"""Measure what snapshots cost: ``python -m tools.snapshot_cost KickTheBall TurnBaby``.

It prints the processor time of taking and restoring one of a single world, and the size of its
file.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import veca_marl

_STEPS, _TIMES = 40, 30


def milliseconds(action: Callable[[], object]) -> float:
    """Return the mean processor time of a call."""
    start = time.process_time()
    for _ in range(_TIMES):
        action()
    return 1e3 * (time.process_time() - start) / _TIMES


def line(task: str) -> str:
    """Return the figures of a task."""
    env = veca_marl.make(task, worlds=1, seed=0)
    env.rollout(_STEPS)
    snapshots = env.snapshot()  # the first builds a second game
    taken, restored = milliseconds(env.snapshot), milliseconds(lambda: env.restore(snapshots))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "snapshot.veca"
        snapshots[0].save(file)
        megabytes = file.stat().st_size / 1e6
    env.close()
    return f"{task}: take {taken:.1f} ms, restore {restored:.1f} ms, {megabytes:.2f} MB"


def main() -> None:
    """Print a line for each task."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=["KickTheBall", "TurnBaby", "ColorSort"])
    for task in parser.parse_args().tasks:
        print(line(task))


if __name__ == "__main__":
    main()
