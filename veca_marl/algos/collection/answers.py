"""Time limits for the answers of worker processes: a process that hangs does not end."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from queue import Empty
from typing import Any

CHECK_S = 1.0
"""Seconds between two checks of processes that are waited for."""


class TimeLimit:
    """Ends the wait for workers that do not answer in time.

    Args:
        seconds: Longest time that an answer may take.
        abandon: Called with the indices of the workers that have not answered; raises an error.
    """

    def __init__(self, seconds: float, abandon: Callable[[list[int]], None]) -> None:
        self.seconds = seconds
        self._abandon = abandon
        self._begin = time.monotonic()

    def begin(self) -> None:
        """Start to measure the time."""
        self._begin = time.monotonic()

    def check(self, silent: list[int]) -> None:
        """Abandon the workers in `silent` if the time is over."""
        if time.monotonic() - self._begin > self.seconds:
            self._abandon(silent)


def no_answer(kind: str, silent: list[int], workers: int, seconds: float) -> str:
    """Return the message about workers that were killed because they did not answer.

    Args:
        kind: What they are, such as ``worker process``.
        silent: Their indices.
        workers: Number of all workers of this kind.
        seconds: The time limit.
    """
    names = " and ".join(map(str, silent))
    plural, was = ("es", "were") if len(silent) > 1 else ("", "was")
    return (
        f"{kind}{plural} {names} (of 0 to {workers - 1}) did not answer for {seconds:g} s "
        f"(collect.answer_limit_s) and {was} killed"
    )


class AnswerPipe:
    """The pipe of a worker, with a time limit for each answer from the last message on.

    The first limit begins when it is made, before the worker starts.

    Args:
        pipe: The pipe of `MultiSyncCollector`.
        index: Index of the worker.
        check: Raises an error if a worker has ended.
        limit: Time limit of an answer.
    """

    def __init__(self, pipe: Any, index: int, check: Callable[[], None], limit: TimeLimit) -> None:
        self._pipe, self._index = pipe, index
        self._check, self._limit = check, limit

    def send(self, message: Any) -> None:
        """Send a message; the time limit of its answer begins."""
        self._limit.begin()
        self._pipe.send(message)

    def poll(self, timeout: float = 0.0) -> bool:
        """Return whether there is a message, after at most `timeout` seconds."""
        until = time.monotonic() + timeout
        while not self._pipe.poll(max(0.0, min(CHECK_S, until - time.monotonic()))):
            if time.monotonic() >= until:
                return False
            self._check()
            self._limit.check([self._index])
        return True

    def recv(self) -> Any:
        """Return the next message, within the time limit."""
        self.poll(math.inf)
        message = self._pipe.recv()
        self._limit.begin()
        return message

    def close(self) -> None:
        """Close the pipe."""
        self._pipe.close()


class BatchQueue:
    """The queue of the workers' batches, with a time limit for each batch of all workers.

    Args:
        queue: The queue of `MultiSyncCollector`.
        workers: Number of workers; each puts one item into the queue for a batch.
        limit: Time limit of a batch.
    """

    def __init__(self, queue: Any, workers: int, limit: TimeLimit) -> None:
        self._queue = queue
        self._all = range(workers)
        self._limit = limit
        self._silent: set[int] = set()

    def get(self, timeout: float) -> Any:
        """Return the next item; raise `Empty` if there is none for `timeout` seconds."""
        if not self._silent:
            self._silent = set(self._all)
            self._limit.begin()
        try:
            item = self._queue.get(timeout=timeout)
        except Empty:
            self._limit.check(sorted(self._silent))
            raise
        self._silent.discard(_sender(item))
        return item

    def close(self) -> None:
        """Close the queue."""
        self._queue.close()


def _sender(item: Any) -> int:
    """Return the index of the worker that sent ``((data, index), n)`` or ``(index, n)``."""
    content, _ = item
    return int(content[1] if isinstance(content, tuple) else content)
