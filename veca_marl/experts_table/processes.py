"""Episodes in several processes at the same time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from veca_marl.experts_table.play import Job, Played, play_in_order


class LostProcessError(RuntimeError):
    """A process ended before it had played its episodes."""


def play_all(jobs: Sequence[Job], processes: int, commit: str) -> Iterator[tuple[Job, Played]]:
    """Play episodes and yield each when it has ended, those of several processes in any order.

    Args:
        jobs: The episodes; those of one task follow each other.
        processes: Number of processes. With 1 the episodes are played in this one.
        commit: Commit of the code.

    Raises:
        ValueError: If a start is not the frozen one.
        LostProcessError: If a process ends before its episodes are played.
    """
    if processes == 1:
        yield from play_in_order(jobs, commit)
        return
    context = get_context("spawn")  # this process may have threads, which a fork would break
    running = {}
    for share in (jobs[n::processes] for n in range(processes)):
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=_play_share, args=(share, commit, sender), daemon=True)
        process.start()
        sender.close()
        running[receiver] = process
    try:
        yield from _received(running)
    finally:
        for process in running.values():
            process.terminate()
            process.join()


def _play_share(share: Sequence[Job], commit: str, results: Connection) -> None:
    """Play in a process of its own and send each episode, then None, or else the error."""
    try:
        for played in play_in_order(share, commit):
            results.send(played)
        results.send(None)
    except ValueError as error:
        results.send(error)


def _received(running: Mapping[Connection, BaseProcess]) -> Iterator[tuple[Job, Played]]:
    connections = list(running)
    while connections:
        for connection in wait(connections):
            assert isinstance(connection, Connection)
            try:
                message = connection.recv()
            except EOFError:
                raise _lost(running[connection]) from None
            if isinstance(message, ValueError):
                raise message
            if message is None:
                connections.remove(connection)
            else:
                yield message


def _lost(process: BaseProcess) -> LostProcessError:
    process.join()
    code = process.exitcode or 0
    how = f"by signal {-code}" if code < 0 else f"with exit status {code}"
    return LostProcessError(
        f"the process {process.pid}, which played episodes, ended {how}; the episodes before are "
        "stored, and the same command plays the others"
    )
