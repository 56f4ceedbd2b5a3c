"""Runs the processes of a sweep, several at a time."""

from __future__ import annotations

import fcntl
import os
import subprocess
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

from veca_marl.sweeps.plans import Action, Plan, SweepError
from veca_marl.sweeps.progress import Progress, frames_so_far

PARENT = "VECA_MARL_PARENT_PID"
"""Environment variable with the process that a run must not outlive."""

_POLL_S = 0.5
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


def run_all(plans: Sequence[Plan], at_once: int, threads: int, progress: Progress) -> list[Plan]:
    """Run the processes of all plans and return those that failed.

    A process that fails does not stop the others. If this one is interrupted, the running ones are
    interrupted as well and have a minute to end. A process that is still running from an earlier
    sweep holds a lock on its log file and counts as failed.

    Args:
        plans: What is to be done.
        at_once: Number of processes at a time.
        threads: Torch threads of runs that have no number of their own.
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
                _start(waiting.popleft(), threads, running, failed, progress)
            time.sleep(_POLL_S)
            for one in [one for one in running if one.process.poll() is not None]:
                running.remove(one)
                _end(one, failed, progress)
            _show(plans, waiting, running, progress)
    finally:
        _interrupt(running, progress)
    return failed


def _start(
    plan: Plan, threads: int, running: list[Running], failed: list[Plan], progress: Progress
) -> None:
    job = plan.job
    job.log.parent.mkdir(parents=True, exist_ok=True)
    environment = {"OMP_NUM_THREADS": str(threads), **os.environ, PARENT: str(os.getpid())}
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
        progress.event(f"failed {job.name} with {_status(status)}: {last_line(one.plan)}")


def _status(code: int) -> str:
    return f"exit status {code}" if code > 0 else f"signal {-code}"


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
    for one in running:
        one.process.terminate()  # `train` takes SIGTERM as Ctrl-C
    deadline = time.monotonic() + _GRACE_S
    for one in running:
        try:
            one.process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            one.process.kill()
            one.process.wait()
