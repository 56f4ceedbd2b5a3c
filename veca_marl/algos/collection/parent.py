"""Worker processes that end together with the process that started them.

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

_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_CHECK_S = 1.0


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
