"""Time limits in the pipes and the queue of TorchRL's workers, which wait without limit."""

from __future__ import annotations

import math
import time
from queue import Empty
from typing import Any

from veca_marl.processes.supervision import CHECK_S, ProcessGroup, TimeLimit


class AnswerPipe:
    """The pipe of a worker, with a time limit for each answer from the last message on.

    The first limit begins when it is made, before the worker starts.

    Args:
        pipe: The pipe of `MultiSyncCollector`.
        index: Index of the worker.
        group: The workers.
    """

    def __init__(self, pipe: Any, index: int, group: ProcessGroup) -> None:
        self._pipe, self._index = pipe, index
        self._check, self._limit = group.check, group.time_limit()

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
