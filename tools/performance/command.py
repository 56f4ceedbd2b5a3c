"""Measure rates of tasks and the cost of training, and write the page of them for users.

It takes about ten minutes on two cores. Commit first: the page names the commit that was measured.

    python -m tools.performance to=docs/performance.md
    python -m tools.performance tasks=[KickTheBall,TurnBaby] steps=10 repeats=1 to=/tmp/page.md
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import veca_marl
from tools.checkout import check_imported
from tools.performance.measure import Plan, measure
from tools.performance.page import COMPARISONS, page
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.config import ConfigError, one_line
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.registry import unknown

_STAGE = ("eval.every_frames=20480", "eval.episodes=4")  # half of the default, each of both
_SHORT_STAGE = ("eval.every_frames=10240", "eval.episodes=2")  # a quarter: SAC is slower
TRAININGS = {
    "PPO": ("+task=KickTheBall", *_STAGE),
    "SAC": ("+task=KickTheBall", "algo=sac", *_SHORT_STAGE),
}
"""Training runs that are timed: evaluations have the default proportion of the frames."""


@dataclass
class PerformanceOptions:
    """Options of the command.

    Attributes:
        to: File of the page.
        tasks: Tasks in its first table; empty takes all of the paper.
        steps: Environment steps of each rollout.
        repeats: Rollouts of each kind; the tables contain medians.
        stages: Measured stages of each training run, one more is not counted.
    """

    to: str = "runs/performance.md"
    tasks: list[str] = field(default_factory=list)
    steps: int = 60
    repeats: int = 3
    stages: int = 1

    def __post_init__(self) -> None:
        for name in ("steps", "repeats", "stages"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        for task in self.tasks:
            if task not in veca_marl.list_tasks():
                raise ValueError(unknown("task", task, veca_marl.list_tasks()))


def plan_of(options: PerformanceOptions) -> Plan:
    """Return what the command measures."""
    return Plan(
        tasks=tuple(options.tasks or veca_marl.list_tasks()),
        comparisons=COMPARISONS,
        trainings=TRAININGS,
        steps=options.steps,
        repeats=options.repeats,
        stages=options.stages,
    )


def run(options: PerformanceOptions, overrides: list[str]) -> None:
    """Measure and write the page.

    Raises:
        ConfigError: If there are other overrides, or a choice is impossible.
        WriteError: If the page cannot be written.
    """
    if overrides:
        raise ConfigError(f"{overrides[0]}: performance measures default configurations only")
    file = check_file(options.to, "to")
    try:
        text = page(measure(plan_of(options)))
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    write_atomically(Path(file), text)
    print(f"page: {file}")


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    check_imported(veca_marl.__file__)
    command = CommandLine(
        "performance",
        PerformanceOptions,
        str(__doc__),
        (WriteError,),
        outputs=("to",),
        places=("to",),
    )
    return command.run(run, words)
