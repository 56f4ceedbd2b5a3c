"""What happens while kernels are compiled: a message, and whatever else is to begin then."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable
from functools import cache
from typing import Any

from numba.core import dispatcher
from numba.core.event import Event, Listener, register

from veca_marl.sim.kernel_cache import KernelCache

_TOLD_EVERY_S = 10.0


class CompilationNotice(Listener):
    """Writes a line when the first kernel of this package is compiled, and then how many are left.

    Kernels that are loaded from the cache are not mentioned. Meanwhile no garbage is collected:
    the compiler makes so many objects that a tenth of its time would be spent on looking for it.

    Args:
        write: Function that takes a line.
        every_s: Time between two lines.

    Attributes:
        begin: Called when the next kernel is compiled; None if nothing is to be called.
    """

    def __init__(self, write: Callable[[str], object], every_s: float = _TOLD_EVERY_S) -> None:
        self.begin: Callable[[], object] | None = None
        self._write, self._every_s = write, every_s
        self._told_s: float | None = None
        self._depth, self._done = 0, 0  # kernels that call others compile these meanwhile
        self._begun_s = 0.0
        self._taken_s = 0.0
        self._collects = False

    def on_start(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        if not _is_ours(event):
            return
        if self._depth == 0:
            self._begun_s = time.process_time()
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1
        if self._told_s is None:
            self._told_s = time.monotonic()
            self._write(_FIRST_LINE)
        begin, self.begin = self.begin, None
        if begin is not None:
            begin()

    def on_end(self, event: Event) -> None:
        """See `numba.core.event.Listener`."""
        if not _is_ours(event) or self._depth == 0:
            return
        self._depth -= 1
        self._done += 1
        if self._depth == 0:
            self._taken_s += time.process_time() - self._begun_s
            if self._collects:
                gc.enable()
        if self._told_s is not None and time.monotonic() - self._told_s >= self._every_s:
            self._told_s = time.monotonic()
            running_s = time.process_time() - self._begun_s if self._depth else 0.0
            self._write(
                f"compiling kernels: {self._done} done, at most {kernels_left()} left, "
                f"{self._taken_s + running_s:.0f} s of processor time"
            )


_FIRST_LINE = "compiling kernels (once; they are cached): about a minute of processor time ..."


def _is_ours(event: Event) -> bool:
    module: str = event.data["dispatcher"].py_func.__module__
    return module.startswith("veca_marl.")


def kernels_left() -> int:
    """Return how many kernels of the imported modules are neither compiled nor in the cache.

    A game needs a part of them only.
    """
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("veca_marl.")]
    named = {id(v): v for module in modules for v in vars(module).values()}
    kernels = [v for v in named.values() if isinstance(v, dispatcher.Dispatcher)]
    return sum(not kernel.overloads and not _is_stored(kernel) for kernel in kernels)


def _is_stored(kernel: Any) -> bool:
    """Return whether something is in the cache of a kernel, or nothing ever will be."""
    if kernel.targetoptions.get("inline") == "always":
        return True
    stored: Any = getattr(kernel, "_cache", None)
    return isinstance(stored, KernelCache) and stored.is_stored


def announce_compilation(begin: Callable[[], object] | None = None) -> None:
    """Install the notice in this process, once.

    It listens to events of numba's compiler: calls of compiled kernels take no additional time.

    Args:
        begin: Called when the next kernel is compiled, if that ever happens.
    """
    _installed().begin = begin


@cache
def _installed() -> CompilationNotice:
    notice = CompilationNotice(_to_stderr)
    register("numba:compile", notice)
    return notice


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr)
