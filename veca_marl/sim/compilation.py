"""Tell the user why the first run takes seconds longer to start."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache

from numba.core.event import Event, Listener, register


class CompilationNotice(Listener):
    """Says so when the first of our kernels is compiled; a cached one is not compiled.

    Args:
        tell: Takes the line.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._told = False

    def on_start(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        module: str = event.data["dispatcher"].py_func.__module__
        if not self._told and module.startswith("veca_marl."):
            self._told = True
            self._tell("compiling kernels (once; they are cached) ...")

    def on_end(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""


@cache
def announce_compilation() -> None:
    """Announce in this process that kernels are compiled, if that happens. Calling twice is fine.

    It listens to numba's compiler, so that compiled kernels cost nothing more.
    """
    register("numba:compile", CompilationNotice(_to_stderr))


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr)
