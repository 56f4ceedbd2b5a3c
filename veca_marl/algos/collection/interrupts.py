"""Ctrl-C and requests to end while worker processes are started, and in these processes.

A terminal sends Ctrl-C to all processes of a command. Workers ignore it: the process that started
them ends them.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_BLOCKED = (signal.SIGINT, signal.SIGTERM)


def block_interrupts() -> Callable[[], None]:
    """Let SIGINT and SIGTERM wait; return what delivers them and receives them as before.

    Processes that are started in between inherit this, until `ignore_interrupts`: they neither end
    by Ctrl-C before they can ignore it, nor lose a request to end. It has no effect on Windows.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return lambda: None
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, _BLOCKED)
    return lambda: _restore(previous)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Let SIGINT and SIGTERM wait until the end of the block, see `block_interrupts`."""
    receive = block_interrupts()
    try:
        yield
    finally:
        receive()


def ignore_interrupts() -> None:
    """Let this process ignore Ctrl-C, and end by SIGTERM. Called by a worker at its start."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _BLOCKED)


def _restore(previous: set[int | signal.Signals]) -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, previous)
