"""Signals and exit codes of child processes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from typing import Any

from veca_marl.algos.collection.interrupts import ignore_interrupts
from veca_marl.algos.collection.parent import end_with_parent


def prepare_child(parent: int) -> None:
    """Prepare this process, which was just started: ignore interrupts, end with the parent.

    Args:
        parent: Process id of the parent.
    """
    ignore_interrupts()
    if hasattr(signal, "SIGCHLD"):
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # the parent's handler is for its children
    end_with_parent(parent)


def call_when_a_child_ends(call: Callable[[], None]) -> Callable[[], None]:
    """Install a handler of SIGCHLD that calls a function when a child process ends.

    The handler that was installed before is called too.

    Returns:
        A function that restores the former handler. It does nothing, and none is installed, outside
        the main thread and on Windows.
    """
    if not hasattr(signal, "SIGCHLD") or threading.current_thread() is not threading.main_thread():
        return lambda: None
    previous: Any = None

    def handle(number: int, frame: Any) -> None:
        call()
        if callable(previous):
            previous(number, frame)

    previous = signal.signal(signal.SIGCHLD, handle)

    def restore() -> None:
        nonlocal previous
        if previous is not None and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGCHLD, previous)
            previous = None

    return restore


def has_ended(process: BaseProcess) -> bool:
    """Return whether a process has ended that has not been closed."""
    try:
        return process.exitcode is not None
    except ValueError:  # torchrl has ended and closed it, because another one had ended
        return False


def is_running(process: BaseProcess) -> bool:
    """Return whether a process has not ended."""
    try:
        return process.is_alive()
    except ValueError:  # closed
        return False


def end_of(process: BaseProcess) -> str:
    """Return how a process has ended, as the rest of a sentence."""
    code = process.exitcode or 0
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = ", which the system sends when memory runs out" if name == "SIGKILL" else ""
    return f"was killed by {name}{hint}"
