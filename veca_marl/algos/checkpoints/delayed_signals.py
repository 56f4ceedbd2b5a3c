"""Signals that wait until something is complete."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_DELAYED = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGCHLD") if name in dir(signal)
]


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Delay what signals raise until the block is done; inside it torch would raise another error.

    They are Ctrl-C, the request to end, and the end of a worker process.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
        return
    received: list[int] = []
    previous = {number: signal.getsignal(number) for number in _DELAYED}
    delayed = {number: action for number, action in previous.items() if callable(action)}
    for number in delayed:
        signal.signal(number, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for number, action in delayed.items():
            signal.signal(number, action)
    for number in received:
        signal.raise_signal(number)
