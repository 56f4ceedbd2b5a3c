"""What a run writes down: tidy CSV rows, TensorBoard curves, and where the time goes."""

from __future__ import annotations

import csv
import math
import os
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch.utils.tensorboard import SummaryWriter

from veca_marl.algos.training.evaluation import team_measures

Row = Mapping[str, float | int | str]


class Reporter(Protocol):
    """Takes rows of numbers."""

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Note `row`, measured after `frames` training frames."""
        ...

    def close(self) -> None:
        """Write what is pending."""
        ...


class CsvReporter:
    """One file per kind of row: ``metrics.csv``, ``evaluations.csv``.

    Args:
        folder: Where the files lie.
        resumed_frames: Rows of later frames, which a resumed run will write again, are dropped;
            all of them at 0.
    """

    def __init__(self, folder: Path, resumed_frames: int = 0) -> None:
        self._folder = folder
        for path in folder.glob("*.csv"):
            _drop_rows_after(path, resumed_frames)

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Append `row` to ``<kind>.csv``; not-a-number is left blank."""
        path = self._folder / f"{kind}.csv"
        full = {"frames": frames, **row}
        new = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, full.keys())
            if new:
                writer.writeheader()
            writer.writerow({name: _cell(value) for name, value in full.items()})

    def close(self) -> None:
        """Nothing is pending: each row is written at once."""


class TensorBoardReporter:
    """One curve per number, named ``kind/name``."""

    def __init__(self, folder: Path, resumed_frames: int = 0) -> None:
        self._writer = SummaryWriter(
            str(folder / "tensorboard"), purge_step=resumed_frames + 1 if resumed_frames else None
        )

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Add a point to each curve; a row's words tell its curves apart."""
        words = [value for value in row.values() if isinstance(value, str)]
        for name, value in row.items():
            if not isinstance(value, str) and math.isfinite(value):
                self._writer.add_scalar("/".join([kind, *words, name]), value, frames)

    def close(self) -> None:
        """Write pending points."""
        self._writer.close()


class TrainingEpisodes:
    """Sums over episodes that begin and end in different batches."""

    def __init__(self) -> None:
        self._open: dict[tuple[str, str], NDArray[np.float64]] = {}

    def restart(self) -> None:
        """Forget unfinished episodes."""
        self._open.clear()

    def add(self, batch: TensorDictBase, team: str) -> dict[str, float]:
        """Return means over the episodes that ended in `batch` ``(worlds, steps)``.

        Returns:
            ``return``, ``length``, each term, not-a-number where no episode ended; and
            ``reward_per_step``, which there always is.
        """
        done = batch["next", "done"].squeeze(-1).cpu().numpy()
        measures = team_measures(batch["next"], team)
        means = {"reward_per_step": float(measures["return"].mean())}
        for name, values in measures.items():
            sums = self._finish((team, name), values, done)
            means[name] = float(np.mean(sums)) if sums else math.nan
        return means

    def _finish(
        self, key: tuple[str, str], values: NDArray[np.float64], done: NDArray[np.bool_]
    ) -> list[float]:
        carried = self._open.setdefault(key, np.zeros(len(values)))
        finished: list[float] = []
        for world, row in enumerate(values):
            pieces = np.split(row, np.flatnonzero(done[world]) + 1)
            sums = [float(piece.sum()) for piece in pieces]
            sums[0] += carried[world]
            carried[world] = sums.pop()
            finished += sums
        return finished


class Stopwatch:
    """Adds up the seconds spent in each named part of the loop."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._start = time.perf_counter()

    @property
    def elapsed_s(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self._start

    @contextmanager
    def measure(self, part: str) -> Iterator[None]:
        """Add the time inside the block to `part`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[part] += time.perf_counter() - start

    def table(self, frames: int) -> str:
        """Return lines of seconds, share and ms per frame of each part."""
        total = self.elapsed_s
        parts = dict(self.seconds)
        parts["other"] = max(0.0, total - sum(parts.values()))
        lines = [f"{'part':<12}{'seconds':>10}{'share':>8}{'ms/frame':>10}"]
        for part, seconds in [*parts.items(), ("total", total)]:
            share, each = seconds / total, 1e3 * seconds / max(frames, 1)
            lines.append(f"{part:<12}{seconds:>10.1f}{share:>8.1%}{each:>10.3f}")
        return "\n".join(lines)


def _cell(value: float | int | str) -> str | int:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return value


def _drop_rows_after(path: Path, frames: int) -> None:
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        columns = reader.fieldnames or []
        kept = [row for row in reader if frames and int(row["frames"]) <= frames]
    temporary = path.with_suffix(".tmp")
    with temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(kept)
    os.replace(temporary, path)
