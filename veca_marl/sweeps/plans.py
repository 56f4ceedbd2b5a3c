"""What is to be done for each run of a sweep: start it, continue it, or leave it as it is."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from veca_marl.override_text import quoted
from veca_marl.runs.continuation import may_change
from veca_marl.sweeps.differences import Difference, differences
from veca_marl.sweeps.run_state import RunState, StoredRun, read_run

_TRAIN = ("-m", "veca_marl.train")
_QUIET = "log.progress_bar=false"  # the sweep has one display for all runs


class SweepError(ValueError):
    """A sweep cannot be started, or some of its runs have failed; the message is one line."""


class Action(Enum):
    """What is done for a run."""

    start = "start"
    resume = "resume"
    skip = "skip"


@dataclass(frozen=True)
class Job:
    """A run that a sweep asks for.

    Attributes:
        name: Its folder within that of the sweep, such as ``hrtf/seed_0``.
        folder: Its folder.
        overrides: The overrides that choose its configuration.
        asked: Its resolved configuration as plain data.
    """

    name: str
    folder: Path
    overrides: Sequence[str]
    asked: Mapping[str, Any]

    @property
    def log(self) -> Path:
        """File with the output of the process."""
        return self.folder.with_name(f"{self.folder.name}.log")

    @property
    def frames(self) -> int:
        """Frames that it is to have."""
        return int(self.asked["total_frames"])


@dataclass(frozen=True)
class Plan:
    """A run, and what is done for it.

    Attributes:
        job: The run.
        action: What is done.
        arguments: Arguments of the Python process that does it; empty if nothing is done.
    """

    job: Job
    action: Action
    arguments: tuple[str, ...] = ()

    @property
    def command(self) -> list[str]:
        """The command of the process."""
        return [sys.executable, *self.arguments]


def plan(job: Job) -> Plan:
    """Return what is to be done for a run.

    A run that has ended is skipped, one that has begun is continued. Its folder has to hold a run
    of the same configuration; budgets, outputs, device and threads may have changed.

    Raises:
        SweepError: If the folder holds a run of another configuration, or cannot be read.
    """
    try:
        stored = read_run(job.folder)
        state = stored.state(job.frames, job.asked["max_minutes"])
    except ValueError as error:
        raise SweepError(str(error)) from error
    if stored.config is None:
        own = [*job.overrides, f"hydra.run.dir={quoted(job.folder)}", _QUIET]
        return Plan(job, Action.start, (*_TRAIN, *own))
    changed = _changed(job, stored)
    if state in (RunState.finished, RunState.cut):
        return Plan(job, Action.skip)
    own = [f"resume={quoted(job.folder)}", _QUIET, *map(_override, changed)]
    return Plan(job, Action.resume, (*_TRAIN, *own))


def _changed(job: Job, stored: StoredRun) -> list[Difference]:
    """Return the values that a run is continued with.

    Raises:
        SweepError: If a value differs that has to stay.
    """
    differing = differences(stored.config or {}, job.asked)
    other = [str(d) for d in differing if not d.of_version and not may_change(d.key)]
    if other:
        raise SweepError(
            f"{job.folder} holds a run of another configuration: {'; '.join(other)}. "
            "Choose another folder with hydra.sweep.dir=..., or remove the run"
        )
    return [d for d in differing if not d.of_version and may_change(d.key) and d.key[:4] != "log."]


def _override(difference: Difference) -> str:
    value = "null" if difference.asked is None else difference.asked
    return f"{difference.key}={value}"
