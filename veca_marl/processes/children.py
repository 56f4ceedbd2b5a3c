"""Child processes: their signals, exit codes, and their end with the process that started them.

A terminal sends Ctrl-C to all processes of a command. Workers ignore it: the process that started
them ends them.

A process that is killed (SIGKILL, out of memory) cannot end its workers, and a forked worker does
not see the end of its pipes, because its siblings hold copies of the other ends.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import parent_process
from multiprocessing.process import BaseProcess
from multiprocessing.util import Finalize
from subprocess import Popen, TimeoutExpired
from typing import Any
from weakref import WeakSet

_INTERRUPTS = (signal.SIGINT, signal.SIGTERM)


def block_interrupts() -> Callable[[], None]:
    """Let SIGINT and SIGTERM wait; return what delivers them and receives them as before.

    Processes that are started in between inherit this, until `ignore_interrupts`: they neither end
    by Ctrl-C before they can ignore it, nor lose a request to end. It has no effect on Windows.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return lambda: None
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, _INTERRUPTS)
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
    """Let this process ignore Ctrl-C, and end by SIGTERM. Called by a worker at its start.

    What it owes to others before its end is left to `call_at_the_end`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _INTERRUPTS)


def _restore(previous: set[int | signal.Signals]) -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, previous)


_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_CHECK_S = 1.0
_KILL_S = 3.0  # a killed process that waits for a device cannot be waited for


def end_with_parent(parent: int) -> None:
    """Let this process end as soon as its parent has ended.

    On Linux the kernel sends SIGKILL when the thread that started this process ends; elsewhere a
    thread reads the parent's process id every second.

    Args:
        parent: Process id of the parent, read by the parent itself.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_end_when_orphaned, args=(parent,), daemon=True).start()
    if os.getppid() != parent:  # it ended before the call above
        os._exit(1)


def _end_when_orphaned(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_CHECK_S)
    os._exit(1)


def prepare_child(parent: int) -> None:
    """Prepare this process, which was just started: ignore interrupts, end with the parent.

    Args:
        parent: Process id of the parent.
    """
    ignore_interrupts()
    if hasattr(signal, "SIGCHLD"):
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # the parent's handler is for its children
    end_with_parent(parent)


_LAST_CALLS: WeakSet[Finalize[None]] = WeakSet()


def call_at_the_end(owner: object, call: Callable[[], None]) -> Finalize[None]:
    """Call a function once: when an object is dropped, or at the end of this process.

    In a process that `multiprocessing` has started, SIGTERM is such an end too, unless the program
    handles this signal itself: pools end their idle processes by it. In a process that is killed
    (SIGKILL) the function is not called.

    Args:
        owner: The object. `call` must not refer to it, or it is not dropped.
        call: The function; a signal may call it between any two instructions of the main thread.

    Returns:
        An object that calls the function at once when it is called; there is no later call then.
        In a process that was forked from this one it does nothing.
    """
    last = Finalize(owner, call, exitpriority=0)
    _LAST_CALLS.add(last)
    # only in child processes: signals of the main process belong to the program
    if parent_process() is not None and _sigterm_is_free():
        signal.signal(signal.SIGTERM, _end_after_last_calls)
    return last


def _sigterm_is_free() -> bool:
    """Return whether this thread can handle SIGTERM, which nothing else does."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    return in_main_thread and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def _end_after_last_calls(number: int, frame: Any) -> None:
    """Make all last calls, then end by the signal, which is the exit code that the parent sees."""
    signal.signal(number, signal.SIG_IGN)  # a second one would cut them off
    with ExitStack() as stack:
        stack.callback(os.kill, os.getpid(), number)
        stack.callback(signal.signal, number, signal.SIG_DFL)
        for last in list(_LAST_CALLS):
            stack.callback(last)


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


def call_when_interrupted(call: Callable[[], None]) -> Callable[[], None]:
    """Call a function first when this process receives SIGINT or SIGTERM.

    Only where the program handles the signal itself: one that ends it, or is ignored, is left so.

    Returns:
        A function that restores the former handlers. It does nothing, and none is installed,
        outside the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        return lambda: None
    restores = [_call_before(number, call) for number in _INTERRUPTS]

    def restore() -> None:
        while restores:
            restores.pop()()

    return restore


def _call_before(number: signal.Signals, call: Callable[[], None]) -> Callable[[], None]:
    previous = signal.getsignal(number)
    if not callable(previous):
        return lambda: None

    def handle(received: int, frame: Any) -> None:
        call()
        previous(received, frame)

    def restore() -> None:
        # a handler that was installed later calls this one
        here = threading.current_thread() is threading.main_thread()
        if here and signal.getsignal(number) is handle:
            signal.signal(number, previous)

    signal.signal(number, handle)
    return restore


def ended_by_interrupt(code: int | None) -> bool:
    """Return whether a process has ended by SIGINT or SIGTERM.

    Args:
        code: ``exitcode`` of the process.
    """
    return code is not None and -code in _INTERRUPTS


def end_of(code: int | None) -> str:
    """Return how a process has ended, as the rest of a sentence.

    Args:
        code: ``exitcode`` or ``returncode`` of the process.
    """
    if code is None or code >= 0:
        return f"ended with exit code {code or 0}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = ", which the system sends when memory runs out" if name == "SIGKILL" else ""
    return f"was killed by {name}{hint}"


def end_all(processes: Sequence[BaseProcess | Popen[bytes]], grace_s: float) -> None:
    """End processes by SIGTERM and wait for them; kill those that do not follow it.

    A process that is stopped (SIGSTOP) receives SIGTERM only when it continues.

    Args:
        processes: The processes; some may have ended.
        grace_s: Seconds from SIGTERM until processes are killed, the same for all.
    """
    for process in processes:
        process.terminate()
    deadline = time.monotonic() + grace_s
    for process in processes:
        if not _ends_within(process, max(deadline - time.monotonic(), 0.0)):
            process.kill()
            _ends_within(process, _KILL_S)


def _ends_within(process: BaseProcess | Popen[bytes], seconds: float) -> bool:
    if isinstance(process, Popen):
        with suppress(TimeoutExpired):
            process.wait(seconds)
        return process.returncode is not None
    process.join(seconds)
    return process.exitcode is not None
