"""What the page needs, measured by the functions of the benchmark."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import torch

from veca_marl.bench.command import machine
from veca_marl.bench.learning import Learning, measure_learning
from veca_marl.bench.rollouts import Rollouts, measure_rollouts
from veca_marl.config import ConfigError, compose
from veca_marl.plugins import conf_dir
from veca_marl.processes.cores import usable_cores
from veca_marl.sim.body import BodyCfg


@dataclass(frozen=True)
class Choice:
    """One row of a table: a game, as it is chosen on the command line.

    Attributes:
        words: Overrides, the task first.
        worlds: Worlds of the environment, all in one process.
    """

    words: tuple[str, ...]
    worlds: int = 1


@dataclass(frozen=True)
class Plan:
    """What is measured.

    Attributes:
        tasks: Tasks that are measured with their default bodies, senses and playgrounds.
        comparisons: Choices that are compared, by a name; the first one is the reference.
        trainings: Overrides of training runs, by the name of the algorithm.
        steps: Environment steps of each rollout.
        repeats: Rollouts of each kind; medians are taken.
        stages: Measured stages of each training run.
    """

    tasks: tuple[str, ...]
    comparisons: Mapping[str, tuple[Choice, ...]]
    trainings: Mapping[str, tuple[str, ...]]
    steps: int
    repeats: int
    stages: int


@dataclass(frozen=True)
class Rate:
    """A measured choice.

    Attributes:
        choice: What was measured.
        body: Name of the preset of the body.
        rollouts: Its rates.
    """

    choice: Choice
    body: str
    rollouts: Rollouts


@dataclass(frozen=True)
class Measured:
    """All results.

    Attributes:
        machine: Names and values that describe the machine, see `veca_marl.bench`.
        cores: Cores that this process may use.
        step_ms: Simulated milliseconds of an agent step at the default clock.
        steps: As in `Plan`.
        repeats: As in `Plan`.
        tasks: One for each task.
        comparisons: Those of each comparison, in the order of its choices.
        learning: Speed of training by the name of the algorithm.
    """

    machine: Mapping[str, object]
    cores: int
    step_ms: float
    steps: int
    repeats: int
    tasks: tuple[Rate, ...]
    comparisons: Mapping[str, tuple[Rate, ...]]
    learning: Mapping[str, Learning]


def measure(plan: Plan) -> Measured:
    """Measure everything in turn; progress is written to the standard error.

    Raises:
        ConfigError: If a choice is impossible.
    """
    found = machine()  # first: the load of the machine is then that of other programs
    bodies = _preset_bodies()
    with _one_thread():
        tasks = tuple(_rates([Choice((f"+task={name}",)) for name in plan.tasks], plan, bodies))
        comparisons = {
            name: tuple(_rates(choices, plan, bodies)) for name, choices in plan.comparisons.items()
        }
    return Measured(
        machine=found,
        cores=usable_cores(),
        step_ms=_default_step_ms(),
        steps=plan.steps,
        repeats=plan.repeats,
        tasks=tasks,
        comparisons=comparisons,
        learning={name: _learning(words, plan) for name, words in plan.trainings.items()},
    )


def _rates(choices: Sequence[Choice], plan: Plan, bodies: Mapping[str, BodyCfg]) -> Iterator[Rate]:
    for choice in choices:
        game = compose(choice.words).game
        start = time.monotonic()
        rollouts = measure_rollouts(game, choice.worlds, plan.steps, plan.repeats)
        _report(f"{' '.join(choice.words)} worlds={choice.worlds}", start)
        yield Rate(choice, _body_name(game.body, bodies), rollouts)


def _learning(words: Sequence[str], plan: Plan) -> Learning:
    start = time.monotonic()
    learning = measure_learning(compose(words), plan.steps, plan.stages)
    _report(" ".join(words), start)
    return learning


def _report(label: str, start: float) -> None:
    sys.stderr.write(f"{label}: {time.monotonic() - start:.0f} s\n")


@contextmanager
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _preset_bodies() -> dict[str, BodyCfg]:
    """Return the body of each preset by its name."""
    names = sorted(path.stem for path in (conf_dir() / "body").glob("*.yaml"))
    return {name: compose(["+task=ObjectNav", f"body={name}"]).game.body for name in names}


def _body_name(body: BodyCfg, presets: Mapping[str, BodyCfg]) -> str:
    """Return the name of the preset that a body is.

    Raises:
        ConfigError: If it is none.
    """
    for name, preset in presets.items():
        if preset == body:
            return name
    raise ConfigError(f"the body {type(body).__name__} is none of {', '.join(presets)}")


def _default_step_ms() -> float:
    clock = compose(["+task=ObjectNav"]).game.clock
    return 1e3 / clock.control_rate_hz
