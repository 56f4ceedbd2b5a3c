"""Supervision of a group of processes: one that has ended or does not answer is named.

A process that is waited for may be killed, or hang: without supervision the wait has no end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import NoReturn

from veca_marl.processes.children import (
    call_when_a_child_ends,
    call_when_interrupted,
    end_of,
    ended_by_interrupt,
)

CHECK_S = 1.0
"""Seconds between two checks of processes that are waited for."""

INTERRUPT_S = 2.0
"""Seconds from the end of a process by SIGTERM until the same signal has reached this process."""


class WorkerError(RuntimeError):
    """A process that should still work has ended, raised an exception or did not answer in time."""


@dataclass(frozen=True)
class Limit:
    """Limit for the silence of a process that is to answer.

    Attributes:
        seconds: Longest silence.
        setting: Field of the configuration that changes it, for error messages.
    """

    seconds: float = math.inf
    setting: str = ""


NO_LIMIT = Limit()
"""For processes of which it is not known how long they are silent."""


class TimeLimit:
    """Measures the silence of processes.

    Args:
        seconds: Longest silence.
        abandon: Called with the indices of the processes that are silent for longer; raises an
            error.
    """

    def __init__(self, seconds: float, abandon: Callable[[list[int]], None]) -> None:
        self._seconds = seconds
        self._abandon = abandon
        self.begin()

    def begin(self) -> None:
        """Start to measure the time."""
        self._begin = time.monotonic()

    @property
    def over(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() - self._begin > self._seconds

    def check(self, silent: list[int]) -> None:
        """Abandon the processes in `silent` if the time is over."""
        if self.over:
            self._abandon(silent)


class ProcessGroup:
    """Processes that all should work: if one fails, the others are killed.

    A job is ended by SIGTERM to all of its processes at once, in any order: that the group ends
    then is no failure. Where the handler of this process raises an error, that error is raised.

    Args:
        kind: What they are, such as ``worker process``.
        processes: Returns them; their order gives their indices.
        limit: Limit for their silence.
        exceptions: Returns the messages of exceptions that have ended some of them, by index.
    """

    def __init__(
        self,
        kind: str,
        processes: Callable[[], Sequence[BaseProcess]],
        limit: Limit,
        exceptions: Callable[[], Mapping[int, str]] = dict,
    ) -> None:
        self._kind, self._processes = kind, processes
        self._limit, self._exceptions = limit, exceptions
        self._failure = ""
        self._checking = self._released = self._interrupted = False
        self._restores: list[Callable[[], None]] = []

    def watch(self) -> None:
        """Call `check` as soon as a process ends, whatever the main thread does then.

        It has no effect outside the main thread and on Windows. Not to be called before all
        processes have been started: Python drops an exception that a signal handler raises within
        a fork.
        """
        self._restores = [
            call_when_a_child_ends(self._on_an_end),
            call_when_interrupted(self._on_an_interrupt),
        ]

    def _unwatch(self) -> None:
        while self._restores:
            self._restores.pop()()

    def _on_an_end(self) -> None:
        # after a failure, which was raised, the others are killed
        if not (self._failure or self._released or self._interrupted):
            self.check()

    def _on_an_interrupt(self) -> None:
        # what its handler raises ends this process: an error about the group would replace it
        self._interrupted = True

    def release(self) -> None:
        """Let the processes end from now on; only calls of `check` report that they have."""
        self._released = True
        self._unwatch()

    def check(self) -> None:
        """Raise an error if a process has ended, or the group has failed before.

        Raises:
            WorkerError: It names all processes that have ended, and how.
        """
        if self._checking:  # called by the signal in the middle of a call
            return
        self._checking = True
        try:
            if not self._failure and self._asked_to_end():
                time.sleep(INTERRUPT_S)  # the handler of this process's own signal raises from here
            failure = self._failure or self._found()
        finally:
            self._checking = False
        if failure:
            self.fail(failure)

    def fail(self, failure: str, details: str = "") -> NoReturn:
        """Kill all processes.

        Args:
            failure: One line.
            details: More lines, for developers.

        Raises:
            WorkerError: Always.
        """
        self._failure = failure
        self._unwatch()  # the others end too
        for process in self._processes():
            if _is_running(process):
                process.kill()
        error = WorkerError(failure)
        if details:
            error.add_note(details)
        raise error

    def time_limit(self) -> TimeLimit:
        """Return a limit for a silence that begins now; beyond it the group fails."""
        return TimeLimit(self._limit.seconds, self.abandon)

    def abandon(self, silent: list[int]) -> NoReturn:
        """Kill all processes because some are silent.

        Args:
            silent: The indices of those.

        Raises:
            WorkerError: Always.
        """
        names = " and ".join(map(str, silent))
        plural, was = ("es", "were") if len(silent) > 1 else ("", "was")
        setting = f" ({self._limit.setting})" if self._limit.setting else ""
        self.fail(
            f"{self._kind}{plural} {names} {self._all()} did not answer for "
            f"{self._limit.seconds:g} s{setting} and {was} killed"
        )

    def name(self, index: int) -> str:
        """Return the name of a process, with its index among all of the group."""
        return f"{self._kind} {index} {self._all()}"

    def _all(self) -> str:
        return f"(of 0 to {len(self._processes()) - 1})"

    def _asked_to_end(self) -> bool:
        """Return whether a process has ended as they do where all of a job are asked to end."""
        return any(_has_ended(p) and ended_by_interrupt(p.exitcode) for p in self._processes())

    def _found(self) -> str:
        """Return which processes have ended, and how; empty if all run."""
        ended = {i: end_of(p.exitcode) for i, p in enumerate(self._processes()) if _has_ended(p)}
        raised = self._exceptions() if ended else {}
        return "; ".join(
            f"{self.name(i)} {end}{f': {raised[i]}' if i in raised else ''}"
            for i, end in ended.items()
        )


def _has_ended(process: BaseProcess) -> bool:
    """Return whether a process has ended that has not been closed."""
    try:
        return process.exitcode is not None
    except ValueError:  # torchrl has ended and closed it, because another one had ended
        return False


def _is_running(process: BaseProcess) -> bool:
    """Return whether a process has not ended."""
    try:
        return process.is_alive()
    except ValueError:  # closed
        return False
