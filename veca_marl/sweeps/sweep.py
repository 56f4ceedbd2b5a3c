"""A sweep: all its runs are planned, then those that have not ended are run, several at a time."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from veca_marl.processes.children import end_all, end_of
from veca_marl.processes.cores import CORES
from veca_marl.runs.continuation import read_progress
from veca_marl.stored_files import read_table_text
from veca_marl.sweeps.plans import Action, Job, Plan, SweepError, plan

_INTERVAL_TERMINAL_S = 2.0
_INTERVAL_FILE_S = 60.0


def frames_so_far(folder: Path) -> int:
    """Return the frames that a run has learnt from.

    They are those of its last batch by ``metrics.csv``, and without that logger those of its last
    checkpoint by ``progress.json``; 0 if the file is damaged or was removed in the meantime, which
    concerns the run and not the display of its progress.
    """
    try:
        return _frames_stored(folder)
    except (OSError, ValueError):
        return 0


def _frames_stored(folder: Path) -> int:
    path = folder / "metrics.csv"
    if not path.is_file():
        stored = read_progress(folder)
        return 0 if stored is None else stored.frames
    lines = read_table_text(path).splitlines()
    first = lines[-1].partition(",")[0] if lines else ""
    return int(first) if first.isdigit() else 0


@dataclass
class Progress:
    """Prints to a terminal, where the line of progress is rewritten, or to a file.

    Attributes:
        total: Frames of all runs.
        runs: Number of all runs.
        out: Where it is printed.
        clock: Returns seconds.
    """

    total: int
    runs: int
    out: TextIO = field(default_factory=lambda: sys.stderr)
    clock: Callable[[], float] = time.monotonic
    _frames_at_start: int = -1
    _started: float = 0.0
    _printed: float = -1e9
    _width: int = 0

    def event(self, text: str) -> None:
        """Print a line that stays, with the time of day."""
        line = f"{time.strftime('%H:%M:%S')} {text}"
        self.out.write(f"{line:<{self._width}}\n")
        self.out.flush()
        self._width = 0

    @property
    def due(self) -> bool:
        """Whether the interval since the last line of progress is over."""
        interval_s = _INTERVAL_TERMINAL_S if self.out.isatty() else _INTERVAL_FILE_S
        return self.clock() - self._printed >= interval_s

    def update(self, frames: int, running: int, ended: int) -> None:
        """Print the progress of all runs, at most once in an interval.

        Args:
            frames: Frames of all runs so far.
            running: Number of runs that are running.
            ended: Number of runs that have ended, failed ones too.
        """
        now = self.clock()
        if self._frames_at_start < 0:
            self._frames_at_start, self._started = frames, now
        if not self.due:
            return
        terminal = self.out.isatty()
        self._printed = now
        text = self.text(frames, running, ended, now)
        if terminal:
            self.out.write(f"{text:<{self._width}}\r")
            self.out.flush()
            self._width = len(text)
        else:
            self.event(text)

    def text(self, frames: int, running: int, ended: int, now: float) -> str:
        """Return the line of progress."""
        share = 100.0 * frames / max(self.total, 1)
        state = f"{ended} of {self.runs} runs ended, {running} running"
        return f"{state}; {frames} of {self.total} frames ({share:.0f} %){self._left(frames, now)}"

    def _left(self, frames: int, now: float) -> str:
        """Return the minutes that are left at the mean rate since the start."""
        done, elapsed = frames - self._frames_at_start, now - self._started
        if done <= 0 or elapsed <= 0:
            return ""
        return f", about {(self.total - frames) * elapsed / done / 60.0:.0f} min left"


PARENT = "VECA_MARL_PARENT_PID"
"""Environment variable with the process that a run must not outlive."""

_POLL_S = 0.5  # commands, not functions: no pipe tells of them, and the display changes meanwhile
_GRACE_S = 60.0  # until interrupted runs are killed; a checkpoint is written within seconds


@dataclass
class Running:
    """A process that is running.

    Attributes:
        plan: What it does.
        process: The process, the first of a session of its own.
        started: When it was started, in seconds of the monotonic clock.
    """

    plan: Plan
    process: subprocess.Popen[bytes]
    started: float

    @property
    def minutes(self) -> float:
        """Minutes since its start."""
        return (time.monotonic() - self.started) / 60.0


def run_all(
    plans: Sequence[Plan], at_once: int, share: Mapping[str, str], progress: Progress
) -> list[Plan]:
    """Run the processes of all plans and return those that failed.

    A process that fails does not stop the others. If this one is interrupted, the running ones are
    interrupted as well and have a minute to end. A process that is still running from an earlier
    sweep holds a lock on its log file and counts as failed.

    Args:
        plans: What is to be done.
        at_once: Number of processes at a time.
        share: Environment variables that say what of the machine a run may use, unless they are
            set.
        progress: The display.

    Raises:
        KeyboardInterrupt: After all processes have ended.
    """
    waiting = deque(plan for plan in plans if plan.action is not Action.skip)
    running: list[Running] = []
    failed: list[Plan] = []
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                _start(waiting.popleft(), share, running, failed, progress)
            time.sleep(_POLL_S)
            for one in [one for one in running if one.process.poll() is not None]:
                running.remove(one)
                _end(one, failed, progress)
            _show(plans, waiting, running, progress)
    finally:
        _interrupt(running, progress)
    return failed


def _start(
    plan: Plan,
    share: Mapping[str, str],
    running: list[Running],
    failed: list[Plan],
    progress: Progress,
) -> None:
    job = plan.job
    job.log.parent.mkdir(parents=True, exist_ok=True)
    environment = {**share, **os.environ, PARENT: str(os.getpid())}
    with job.log.open("ab") as log:
        try:
            _lock(log)
        except SweepError as error:
            failed.append(plan)
            progress.event(str(error))
            return
        process = subprocess.Popen(
            plan.command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=environment,
            start_new_session=True,  # Ctrl-C at the terminal reaches this process alone
        )
    running.append(Running(plan, process, time.monotonic()))
    progress.event(f"{plan.action.value} {job.name}; log: {job.log}")


def _lock(log: BinaryIO) -> None:
    """Lock a log file; the process that inherits it holds the lock until it ends.

    Raises:
        SweepError: If another process holds it.
    """
    try:
        fcntl.flock(log, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise SweepError(f"{log.name} is in use: its run has not ended") from error


def _end(one: Running, failed: list[Plan], progress: Progress) -> None:
    status, job = one.process.returncode, one.plan.job
    if status == 0:
        progress.event(f"finished {job.name} after {one.minutes:.1f} min")
    else:
        failed.append(one.plan)
        progress.event(f"failed {job.name}, which {end_of(status)}: {last_line(one.plan)}")


def last_line(plan: Plan) -> str:
    """Return the last line of the log of a run; without a log or lines, where it would be."""
    log = plan.job.log
    lines = log.read_text(errors="replace").split("\n") if log.is_file() else []
    return next((line.strip() for line in reversed(lines) if line.strip()), f"see {log}")


def _show(
    plans: Sequence[Plan], waiting: deque[Plan], running: list[Running], progress: Progress
) -> None:
    """Show the frames of all runs; those that are skipped have all of theirs.

    The frames of a run are in a file, which is not read more often than they are printed.
    """
    if not progress.due:
        return
    done = [
        job.frames if plan.action is Action.skip else min(frames_so_far(job.folder), job.frames)
        for plan in plans
        for job in [plan.job]
    ]
    progress.update(sum(done), len(running), len(plans) - len(waiting) - len(running))


def _interrupt(running: Sequence[Running], progress: Progress) -> None:
    """Interrupt processes and wait until they have ended; kill those that do not."""
    if not running:
        return
    progress.event(f"interrupting {len(running)} runs; the same command continues them")
    # `train` takes SIGTERM as Ctrl-C
    end_all([one.process for one in running], _GRACE_S)


def cores_of(config: Mapping[str, Any]) -> int:
    """Return the number of cores that a run has to itself, at least.

    Its worker processes and its learner take turns, so it is the larger of both. A run without
    numbers of its own gives the same results on one core, which it uses all the time; on several,
    its learner and its worker processes wait for each other. Actors of Ray are as many as groups.
    """
    collect = config["collect"]
    processes = collect["processes"]
    if processes is None:
        processes = collect["groups"] if collect["engine"] == "ray" else 1
    return int(max(1, processes * collect["threads"], config["threads"] or 1))


def default_jobs(configs: list[Mapping[str, Any]], cores: int) -> int:
    """Return the number of runs at a time that fills the cores, at least one."""
    return max(1, min(len(configs), cores // max(map(cores_of, configs), default=1)))


Fit = Callable[[Sequence[Job], int], int]
"""Returns how many of some jobs fit into the memory of the machine, whichever of them they are.

The number is that of the cores of each job, on which the number of its processes depends.

It raises `ValueError` if one does not fit alone.
"""


def run_sweep(jobs: Sequence[Job], most: int | None, cores: int, fit: Fit) -> None:
    """Run all jobs that have not ended.

    Nothing is started if one of them cannot be planned.

    Args:
        jobs: The runs.
        most: Largest number of runs at a time; None is as many as the cores can run at once.
        cores: Number of cores, which the runs at a time share.
        fit: Limits the number of runs at a time further.

    Raises:
        SweepError: If a folder belongs to two jobs or to a run of another configuration, or if
            jobs failed; the message names all of them with their log files.
        ValueError: If a run does not fit into the memory alone.
        KeyboardInterrupt: After all processes have ended.
    """
    for folder, count in Counter(job.folder for job in jobs).items():
        if count > 1:
            raise SweepError(f"{count} jobs have the folder {folder}: set hydra.sweep.subdir")
    plans = [plan(job) for job in jobs]
    progress = Progress(sum(job.frames for job in jobs), len(jobs))
    left = [one.job for one in plans if one.action is not Action.skip]
    asked = most or default_jobs([job.asked for job in left], cores)
    # processes as many as fit; threads, which need no memory, on all cores
    cores_each = max(1, cores // asked)
    at_once = min(asked, fit(left, cores_each)) if left else asked
    threads = max(1, cores // at_once)
    progress.event(_announcement(plans, at_once, asked))
    share = {"OMP_NUM_THREADS": str(threads), CORES: str(cores_each)}
    failed = run_all(plans, at_once, share, progress)
    if failed:
        logs = ", ".join(f"{one.job.name} ({one.job.log})" for one in failed)
        raise SweepError(f"{len(failed)} of {len(jobs)} runs failed: {logs}")
    progress.event(f"all {len(jobs)} runs have ended")


def _announcement(plans: Sequence[Plan], at_once: int, asked: int) -> str:
    counts = Counter(one.action for one in plans)
    limit = f", because {asked} do not fit into the memory" if at_once < asked else ""
    return (
        f"{len(plans)} runs: {counts[Action.skip]} skipped (they have ended), "
        f"{counts[Action.resume]} to continue, {counts[Action.start]} to start; "
        f"at most {at_once} at a time{limit}"
    )
