"""Elapsed and processor time of a training run, batch by batch."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from pathlib import Path


def processor_seconds() -> float:
    """Return the processor time of this process and of its children so far, in seconds.

    It hardly depends on what else the machine computes, elapsed time does. Not a number where the
    system does not tell the processor time of other processes (no `/proc`).
    """
    ended = os.times()
    running = (child.pid for child in multiprocessing.active_children())
    others = sum(_processor_seconds_of(pid) for pid in running if pid is not None)
    return time.process_time() + ended.children_user + ended.children_system + others


def _processor_seconds_of(process: int) -> float:
    """Return the processor time of another process so far; not a number without `/proc`."""
    file = Path(f"/proc/{process}/stat")
    if not file.is_file():
        return float("nan")
    # proc(5): the name in parentheses may contain spaces; utime and stime are the fields 14 and 15
    fields = file.read_text().rpartition(")")[2].split()
    ticks = int(fields[11]) + int(fields[12])
    return ticks / float(os.sysconf("SC_CLK_TCK"))


class Stopwatch:
    """Times of the batches of a run.

    Args:
        elapsed_s: Returns the seconds since the start of the run.
        processor_s: Returns the seconds of processor time so far.
    """

    def __init__(
        self,
        elapsed_s: Callable[[], float],
        processor_s: Callable[[], float] = processor_seconds,
    ) -> None:
        self._elapsed_s, self._processor_s = elapsed_s, processor_s
        self._start_s = 0.0
        self._end_s: float | None = None
        self._processor_end_s: float | None = None

    def begin(self) -> None:
        """Begin a batch."""
        self._start_s = self._elapsed_s()
        if self._processor_end_s is None:
            self._processor_end_s = self._processor_s()

    def end(self, frames: int) -> dict[str, float]:
        """End a batch of a number of frames.

        Returns:
            ``frames_per_s`` of the batch, ``between_s``: elapsed seconds of evaluations,
            checkpoints and restarts since the last batch of this process, and ``processor_s``:
            seconds of processor time of all processes since the last batch.
        """
        now, processor = self._elapsed_s(), self._processor_s()
        used = processor - (self._processor_end_s or 0.0)
        between = 0.0 if self._end_s is None else self._start_s - self._end_s
        rate = frames / (now - self._start_s)
        self._end_s, self._processor_end_s = now, processor
        return {"frames_per_s": rate, "between_s": between, "processor_s": used}
