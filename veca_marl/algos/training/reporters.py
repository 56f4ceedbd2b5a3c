"""Where the numbers of a run go: CSV files, a list, or a logger of TorchRL."""

from __future__ import annotations

import csv
import math
import os
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from torchrl.record.loggers import Logger

Row = Mapping[str, float | int | str]


class Reporter(Protocol):
    """Receives rows of numbers."""

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Record `row`, measured after `frames` training frames.

        Args:
            kind: ``metrics`` for a row per batch, ``evaluations`` for a row per evaluated team.
            frames: See above.
            row: Name to value; words tell rows of one kind and one number of frames apart.
        """
        ...

    def close(self) -> None:
        """Write what is pending."""
        ...


class MemoryReporter:
    """Keeps the rows.

    Attributes:
        rows: Kind to rows, each with the column ``frames``.
    """

    def __init__(self) -> None:
        self.rows: dict[str, list[dict[str, Any]]] = defaultdict(list)

    def write(self, kind: str, frames: int, row: Row) -> None:
        """See `Reporter`."""
        self.rows[kind].append({"frames": frames, **row})

    def close(self) -> None:
        """See `Reporter`; nothing is pending."""


class CsvReporter:
    """One tidy file per kind of row: ``metrics.csv``, ``evaluations.csv``.

    TorchRL's `CSVLogger` writes a file for each number; here one table holds a run, and a resumed
    run drops the rows that it writes again.

    Args:
        folder: Folder of the files.
        resumed_frames: Rows after so many frames are dropped; all of them at 0.
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
        """See `Reporter`; nothing is pending: each row is written at once."""


class LoggerReporter:
    """One curve per number, named ``kind/name``, in a logger of TorchRL.

    Args:
        logger: The logger.
    """

    def __init__(self, logger: Logger) -> None:
        self._logger = logger

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Add a point to each curve; a row's words become part of the names of its curves."""
        words = [value for value in row.values() if isinstance(value, str)]
        for name, value in row.items():
            if not isinstance(value, str) and math.isfinite(value):
                self._logger.log_scalar("/".join([kind, *words, name]), float(value), step=frames)

    def close(self) -> None:
        """Write pending points."""
        self._logger.close()


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
