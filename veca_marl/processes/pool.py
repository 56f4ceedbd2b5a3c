"""A pool of processes that serve requests."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from veca_marl.processes.children import end_all, interrupts_blocked, prepare_child
from veca_marl.processes.supervision import CHECK_S, NO_LIMIT, Limit, ProcessGroup, TimeLimit

END_S = 3.0
"""Seconds until a process that does not follow SIGTERM is killed; others end at once."""

MakeServer = Callable[[Callable[[], None]], Callable[[Any], Any]]
"""Makes, in a process, what returns the answer to a request.

It is given a function that tells this process of progress; a server may call it at any time.
"""


class ProcessPool:
    """Processes that serve requests, each one at a time.

    They end with this process. Each counts its progress in shared memory, which distinguishes a
    process that hangs from one that computes for long.

    Args:
        kind: What a process is, for error messages, such as ``evaluation process``.
        make_server: Called in each process. With ``spawn`` it is pickled.
        processes: Number of processes.
        limit: Limit for the silence of a process: the time without progress and answer.
        method: How the processes are started: ``spawn`` or ``fork``. A process that has threads
            must not be forked.

    Raises:
        WorkerError: If a process ends, raises an exception or is silent for too long; from every
            method, and, where this object is made in the main thread, as soon as a process ends
            from whatever the main thread does.
    """

    def __init__(
        self,
        kind: str,
        make_server: MakeServer,
        processes: int,
        limit: Limit = NO_LIMIT,
        method: str = "spawn",
    ) -> None:
        self._workers: list[_Worker] = []
        self._group = ProcessGroup(kind, lambda: [w.process for w in self._workers], limit)
        context = get_context(method)
        try:
            with interrupts_blocked():
                for _ in range(processes):
                    self._workers.append(_start(context, make_server, self._group.time_limit()))
        except BaseException:
            self.close()
            raise
        self._group.watch()

    def answers(self, requests: Iterable[Any]) -> Iterator[tuple[int, Any]]:
        """Send the first requests; return the number and the answer of each, in any order.

        The first process gets the first request and so on; the others are sent when a process has
        answered. All answers are to be received before the next call.
        """
        left = enumerate(requests)
        asked: dict[int, int] = {}
        for index in range(len(self._workers)):
            self._send_next(index, left, asked)
        return self._received(left, asked)

    def _send_next(
        self, index: int, left: Iterator[tuple[int, Any]], asked: dict[int, int]
    ) -> None:
        """Send the next request, if there is one; its number is entered in `asked`."""
        for number, request in left:
            asked[index] = number
            with self._worker_errors(index):
                self._workers[index].send(request)
            return

    def _received(
        self, left: Iterator[tuple[int, Any]], asked: dict[int, int]
    ) -> Iterator[tuple[int, Any]]:
        while asked:
            ready = set(wait([one for i in asked for one in self._workers[i].waitables], CHECK_S))
            answering = [i for i in asked if not ready.isdisjoint(self._workers[i].waitables)]
            silent = [i for i in asked if i not in answering and self._workers[i].silent]
            if silent:
                self._group.abandon(silent)
            for index in answering:
                number, answer = asked.pop(index), self._receive(index)
                self._send_next(index, left, asked)
                yield number, answer

    def _receive(self, index: int) -> Any:
        """Return the answer of a process that has answered or ended."""
        with self._worker_errors(index):
            answer = self._workers[index].receive()
        if isinstance(answer, _Raised):
            self._group.fail(f"{self._group.name(index)}: {answer.message}", answer.trace)
        return answer

    @contextmanager
    def _worker_errors(self, index: int) -> Iterator[None]:
        """Raise `WorkerError` instead of an error of the pipe if the process has ended."""
        try:
            yield
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._workers[index].process.join(END_S)
            self._group.check()
            raise

    def close(self) -> None:
        """End the processes."""
        self._group.release()
        end_all([worker.process for worker in self._workers], END_S)
        for worker in self._workers:  # now: a process that answers would see a broken pipe
            worker.connection.close()


@dataclass(frozen=True)
class _Raised:
    """An exception that was raised in a process.

    Attributes:
        message: Its class and text.
        trace: Its traceback.
    """

    message: str
    trace: str


@dataclass
class _Worker:
    """A process of a pool, as seen from the one that started it.

    Attributes:
        process: The process.
        connection: Requests go there, answers come from it.
        progress: Shared with the process, which counts its progress in it.
        limit: Measures its silence.
        seen: The last progress that was seen.
    """

    process: BaseProcess
    connection: Connection[Any, Any]
    progress: Any
    limit: TimeLimit
    seen: int = 0

    @property
    def waitables(self) -> list[Any]:
        """What becomes ready when it answers or ends."""
        return [self.connection, self.process.sentinel]

    def send(self, request: Any) -> None:
        """Send a request; the limit for its silence begins."""
        self.limit.begin()
        self.connection.send(request)

    def receive(self) -> Any:
        """Return the next answer; raise `EOFError` if it has ended without one."""
        if not self.connection.poll():
            raise EOFError
        return self.connection.recv()

    @property
    def silent(self) -> bool:
        """Whether its time is over, which begins anew with each progress that is seen here."""
        if self.progress.value != self.seen:
            self.seen = self.progress.value
            self.limit.begin()
        return self.limit.over


def _start(context: Any, make_server: MakeServer, limit: TimeLimit) -> _Worker:
    connection, end = context.Pipe()
    progress = context.RawValue("Q", 0)
    arguments = (end, progress, os.getpid(), make_server)
    process = context.Process(target=_serve, args=arguments, daemon=True)
    process.start()
    end.close()
    return _Worker(process, connection, progress, limit)


def _serve(
    connection: Connection[Any, Any], progress: Any, parent: int, make_server: MakeServer
) -> None:
    """Answer requests, the last one by an exception, until this process is ended."""
    prepare_child(parent)
    requests = _requests(connection)
    try:
        server = make_server(partial(_count, progress))
        for request in requests:
            connection.send(server(request))
    except Exception as error:
        connection.send(_Raised(f"{type(error).__name__}: {error}", traceback.format_exc()))
        for _ in requests:  # ending before the message is read would hide it
            pass


def _requests(connection: Connection[Any, Any]) -> Iterator[Any]:
    """Return requests until the other end is closed."""
    with suppress(EOFError):
        while True:
            yield connection.recv()


def _count(progress: Any) -> None:
    progress.value += 1
