"""The display of a sweep: a line for each event, and one for the progress of all runs."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from veca_marl.runs.run_progress import read_progress

_INTERVAL_TERMINAL_S = 2.0
_INTERVAL_FILE_S = 60.0


def frames_so_far(folder: Path) -> int:
    """Return the frames that a run has learnt from.

    They are those of its last batch by ``metrics.csv``, and without that logger those of its last
    checkpoint by ``progress.json``; 0 if the file is damaged or was removed in the meantime, which
    concerns the run and not the display of its progress.
    """
    try:
        return _frames_stored(folder)
    except (OSError, ValueError):
        return 0


def _frames_stored(folder: Path) -> int:
    path = folder / "metrics.csv"
    if not path.is_file():
        stored = read_progress(folder)
        return 0 if stored is None else stored.frames
    lines = path.read_text().splitlines()
    first = lines[-1].partition(",")[0] if lines else ""
    return int(first) if first.isdigit() else 0


@dataclass
class Progress:
    """Prints to a terminal, where the line of progress is rewritten, or to a file.

    Attributes:
        total: Frames of all runs.
        runs: Number of all runs.
        out: Where it is printed.
        clock: Returns seconds.
    """

    total: int
    runs: int
    out: TextIO = field(default_factory=lambda: sys.stderr)
    clock: Callable[[], float] = time.monotonic
    _frames_at_start: int = -1
    _started: float = 0.0
    _printed: float = -1e9
    _width: int = 0

    def event(self, text: str) -> None:
        """Print a line that stays, with the time of day."""
        line = f"{time.strftime('%H:%M:%S')} {text}"
        self.out.write(f"{line:<{self._width}}\n")
        self.out.flush()
        self._width = 0

    @property
    def due(self) -> bool:
        """Whether the interval since the last line of progress is over."""
        interval_s = _INTERVAL_TERMINAL_S if self.out.isatty() else _INTERVAL_FILE_S
        return self.clock() - self._printed >= interval_s

    def update(self, frames: int, running: int, ended: int) -> None:
        """Print the progress of all runs, at most once in an interval.

        Args:
            frames: Frames of all runs so far.
            running: Number of runs that are running.
            ended: Number of runs that have ended, failed ones too.
        """
        now = self.clock()
        if self._frames_at_start < 0:
            self._frames_at_start, self._started = frames, now
        if not self.due:
            return
        terminal = self.out.isatty()
        self._printed = now
        text = self.text(frames, running, ended, now)
        if terminal:
            self.out.write(f"{text:<{self._width}}\r")
            self.out.flush()
            self._width = len(text)
        else:
            self.event(text)

    def text(self, frames: int, running: int, ended: int, now: float) -> str:
        """Return the line of progress."""
        share = 100.0 * frames / max(self.total, 1)
        state = f"{ended} of {self.runs} runs ended, {running} running"
        return f"{state}; {frames} of {self.total} frames ({share:.0f} %){self._left(frames, now)}"

    def _left(self, frames: int, now: float) -> str:
        """Return the minutes that are left at the mean rate since the start."""
        done, elapsed = frames - self._frames_at_start, now - self._started
        if done <= 0 or elapsed <= 0:
            return ""
        return f", about {(self.total - frames) * elapsed / done / 60.0:.0f} min left"
