"""A message to the user while kernels are compiled, which delays the first run by seconds."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache

from numba.core.event import Event, Listener, register


class CompilationNotice(Listener):
    """Writes one line when the first kernel of this package is compiled, not loaded from a cache.

    Args:
        write: Function that takes the line.
    """

    def __init__(self, write: Callable[[str], object]) -> None:
        self._write = write
        self._is_written = False

    def on_start(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        module: str = event.data["dispatcher"].py_func.__module__
        if not self._is_written and module.startswith("veca_marl."):
            self._is_written = True
            self._write("compiling kernels (once; they are cached) ...")

    def on_end(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""


@cache
def announce_compilation() -> None:
    """Install the notice in this process; further calls have no effect.

    It listens to events of numba's compiler: calls of compiled kernels take no additional time.
    """
    register("numba:compile", CompilationNotice(_to_stderr))


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr)
