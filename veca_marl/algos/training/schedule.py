"""How long a run trains, in which batches and stages, and how much time and memory they take."""

from __future__ import annotations

import math
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import torch
from torchrl import timeit
from tqdm import tqdm


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


def device_memory(device: torch.device) -> dict[str, float]:
    """Return ``gpu_memory_gb``, the most that tensors took since the last call; empty on a CPU."""
    if device.type != "cuda":
        return {}
    most = torch.cuda.max_memory_allocated(device)
    torch.cuda.reset_peak_memory_stats(device)
    return {"gpu_memory_gb": most / 1e9}


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


_LEAST_EARLY_BATCHES = 2


@dataclass(frozen=True)
class Schedule:
    """The numbers of batches of a run and of its stages; the last stage may have fewer.

    A run begins with a short stage, where stages are long enough: it ends with a checkpoint and
    without an evaluation, so that a run that is interrupted early has something to continue from.
    Worlds start new episodes after it: an episode has to fit into the stage that follows.

    Attributes:
        batches: Batches of the run, at least 1.
        batches_per_stage: Batches between two evaluations, at least 1.
        frames_per_batch: Frames of a batch, at least 1.
        batches_per_episode: Batches of the longest episode; 0 if it is not known.
    """

    batches: int
    batches_per_stage: int
    frames_per_batch: int
    batches_per_episode: int = 0

    @classmethod
    def of(
        cls,
        total_frames: int,
        frames_per_stage: int,
        frames_per_batch: int,
        batches_per_episode: int = 0,
    ) -> Schedule:
        """Return the schedule of at least `total_frames`; stages are rounded up to whole batches.

        Args:
            total_frames: Frames of the run.
            frames_per_stage: Frames between two evaluations.
            frames_per_batch: Frames of a batch.
            batches_per_episode: Batches of the longest episode; 0 if it is not known.
        """
        return cls(
            math.ceil(total_frames / frames_per_batch),
            math.ceil(frames_per_stage / frames_per_batch),
            frames_per_batch,
            batches_per_episode,
        )

    @property
    def frames(self) -> int:
        """Frames of the run."""
        return self.batches * self.frames_per_batch

    @property
    def early_batches(self) -> int:
        """Batches of the short first stage; 0 without one."""
        quarter = self.batches_per_stage // 4
        fits = self.batches_per_stage - quarter >= self.batches_per_episode
        return quarter if fits and _LEAST_EARLY_BATCHES <= quarter < self.batches else 0

    def is_evaluated(self, batches: int) -> bool:
        """Return whether the stage that ends after a number of batches ends with an evaluation."""
        return batches != self.early_batches

    def is_within_stage(self, batches: int) -> bool:
        """Return whether a stage of a run that was not interrupted goes on after some batches."""
        return batches % self.batches_per_stage != 0 and batches != self.early_batches

    def stages_after(self, batches: int) -> Iterator[int]:
        """Yield the number of batches of each stage that follows a number of finished batches."""
        while batches < self.batches:
            end = (batches // self.batches_per_stage + 1) * self.batches_per_stage
            if batches < self.early_batches:
                end = self.early_batches
            yield min(end, self.batches) - batches
            batches = end


@dataclass
class Budget:
    """How long to train.

    Attributes:
        total_frames: Frames of experience (rounded up to whole batches).
        max_minutes: Also stop after the stage in which this time runs out, which begins anew when a
            run is resumed; None for no limit.
    """

    total_frames: int
    max_minutes: float | None = None

    def is_spent(self, elapsed_s: float) -> bool:
        """Return whether the time has run out."""
        return self.max_minutes is not None and elapsed_s > 60.0 * self.max_minutes


@dataclass
class Progress:
    """Where a run stands; stored in its checkpoints.

    Attributes:
        stage: Finished stages.
        iteration: Finished batches.
        frames: Frames learnt from.
        best_return: Best mean return of the evaluations, where one team learns.
    """

    stage: int = 0
    iteration: int = 0
    frames: int = 0
    best_return: float = -math.inf

    @classmethod
    def stored(cls, content: Mapping[str, Any]) -> Progress:
        """Return the progress in a checkpoint.

        Raises:
            KeyError: If an entry is missing.
            ValueError: If one is something else.
        """
        counted: dict[str, Any] = {key: content[key] for key in ("stage", "iteration", "frames")}
        best: Any = content["best_return"]
        if any(type(count) is not int or count < 0 for count in counted.values()):
            raise ValueError(f"no progress: {counted}")
        if type(best) not in (int, float) or math.isnan(best):
            raise ValueError(f"no progress: best_return={best!r:.80}")
        return cls(**counted, best_return=best)


class ProgressDisplay:
    """A bar in a terminal; in any other file, such as the log of a job, a line after each stage.

    Args:
        total: Frames of the run.
        initial: Frames learnt from before.
        shown: Whether there is one.
        file: Where to; None is the error output.
    """

    def __init__(self, total: int, initial: int, shown: bool, file: TextIO | None = None) -> None:
        self._file = sys.stderr if file is None else file
        self._lines = shown and not self._file.isatty()
        unseen = not shown or self._lines
        self._bar = tqdm(
            total=total, initial=initial, unit=" frames", disable=unseen, file=self._file
        )
        self._frames, self._total, self._initial = initial, total, initial
        self._means: dict[str, str] = {}
        self._start_s = time.monotonic()

    def update(self, frames: int, means: Mapping[str, float]) -> None:
        """Add frames, and show the mean returns."""
        self._frames += frames
        self._means = {name: f"{value:.3g}" for name, value in means.items()}
        self._bar.update(frames)
        self._bar.set_postfix(self._means)

    def end_stage(self) -> None:
        """Write a line, where there is no bar."""
        if self._lines:
            meter = tqdm.format_meter(
                self._frames,
                self._total,
                time.monotonic() - self._start_s,
                unit=" frames",
                postfix=", ".join(f"{name}={mean}" for name, mean in self._means.items()),
                initial=self._initial,
                bar_format="{n_fmt} of {total_fmt} frames, {elapsed}<{remaining}, {rate_fmt}"
                "{postfix}",
            )
            self._file.write(f"{meter}\n")
            self._file.flush()

    def close(self) -> None:
        """End the bar."""
        self._bar.close()


def timing_table(elapsed_s: float, frames: int) -> str:
    """Return lines of seconds, share and milliseconds per frame of each part.

    Beyond `timeit.print`: shares of the whole, the time that no part accounts for, and the time
    per frame. A part of another one, such as ``evaluate/video``, has a line after the total: its
    time is counted in both.

    Args:
        elapsed_s: The whole time.
        frames: Frames learnt from in it.
    """
    # `timeit.erase` leaves the names of parts, with no time
    measured = {name: s for name, s in timeit.todict(percall=False).items() if s > 0.0}
    parts = {name: s for name, s in measured.items() if "/" not in name}
    within = [(name, s) for name, s in measured.items() if "/" in name]
    parts["other"] = max(0.0, elapsed_s - sum(parts.values()))
    lines = [f"{'part':<16}{'seconds':>10}{'share':>8}{'ms/frame':>10}"]
    for part, seconds in [*parts.items(), ("total", elapsed_s), *within]:
        share, each = seconds / elapsed_s, f"{1e3 * seconds / frames:.3f}" if frames else "-"
        lines.append(f"{part:<16}{seconds:>10.1f}{share:>8.1%}{each:>10}")
    return "\n".join(lines)
