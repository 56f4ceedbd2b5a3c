"""Where the numbers of a run go: CSV files, a list, or a logger of TorchRL."""

from __future__ import annotations

import csv
import io
import math
import os
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from torchrl.record.loggers import Logger

from veca_marl.algos.files import WriteError, write_atomically, write_errors

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

    def sync(self) -> None:
        """Let the rows so far survive a power cut: a checkpoint that follows them is written."""
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

    def sync(self) -> None:
        """See `Reporter`; nothing is stored."""

    def close(self) -> None:
        """See `Reporter`; nothing is pending."""


class CsvReporter:
    """One tidy file per kind of row: ``metrics.csv``, ``evaluations.csv``.

    TorchRL's `CSVLogger` writes a file for each number; here one table holds a run, and a resumed
    run drops the rows that it writes again. Numbers that the first row does not have become columns
    when they are first written.

    Args:
        folder: Folder of the files.
        resumed_frames: Rows after so many frames are dropped; all of them at 0.

    Raises:
        WriteError: If a file cannot be written; `write` raises it too.
    """

    KINDS = ("metrics", "evaluations")

    def __init__(self, folder: Path, resumed_frames: int = 0) -> None:
        self._folder = folder
        for kind in self.KINDS:
            _drop_rows_after(folder / f"{kind}.csv", resumed_frames)
        self._columns = {kind: _columns(folder / f"{kind}.csv") for kind in self.KINDS}

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Append `row` to ``<kind>.csv``; not-a-number is left blank."""
        path = self._folder / f"{kind}.csv"
        full = {"frames": frames, **row}
        columns = self._columns[kind] if path.exists() else []
        added = [name for name in full if name not in columns]
        if columns and added:
            _add_columns(path, added)
        cells = {name: _cell(value) for name, value in full.items()}
        row_text = _table([*columns, *added], [cells], header=not columns)
        with write_errors(path), path.open("a", newline="") as file:
            file.write(row_text)
        self._columns[kind] = [*columns, *added]

    def sync(self) -> None:
        """See `Reporter`."""
        for path in (self._folder / f"{kind}.csv" for kind in self.KINDS):
            if path.exists():
                with write_errors(path), path.open("a") as file:
                    os.fsync(file.fileno())

    def close(self) -> None:
        """See `Reporter`; nothing is pending: each row is written at once."""


class LoggerReporter:
    """One curve per number, named ``kind/name``, in a logger of TorchRL.

    Args:
        logger: The logger.
        path: Where it writes.

    Raises:
        WriteError: If it cannot write there; `write` and `close` raise it.
    """

    def __init__(self, logger: Logger, path: Path) -> None:
        self._logger, self._path = logger, path

    def write(self, kind: str, frames: int, row: Row) -> None:
        """Add a point to each curve; a row's words become part of the names of its curves."""
        words = [value for value in row.values() if isinstance(value, str)]
        for name, value in row.items():
            if not isinstance(value, str) and math.isfinite(value):
                curve = "/".join([kind, *words, name])
                with write_errors(self._path):
                    self._logger.log_scalar(curve, float(value), step=frames)

    def sync(self) -> None:
        """See `Reporter`; the logger decides when it writes."""

    def close(self) -> None:
        """Write pending points."""
        with write_errors(self._path):
            self._logger.close()


def _columns(path: Path) -> list[str]:
    """Return the names in the first line of a table; nothing if there is no such file."""
    if not path.exists():
        return []
    with write_errors(path), path.open(newline="") as file:
        return next(csv.reader(file), [])


def _add_columns(path: Path, names: Sequence[str]) -> None:
    """Add columns to a table, which are blank in its rows."""
    with write_errors(path), path.open(newline="") as file:
        reader = csv.DictReader(file)
        rows = list(reader)
    write_atomically(path, _table([*(reader.fieldnames or []), *names], rows, header=True))


def _cell(value: float | int | str) -> str | int:
    if not isinstance(value, float):
        return value
    if not math.isfinite(value):
        return ""
    return f"{value:.0f}" if value.is_integer() else f"{value:.6g}"  # numbers of frames in full


def _table(columns: Iterable[str], rows: Iterable[Mapping[str, Any]], header: bool) -> str:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(columns))
    if header:
        writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _drop_rows_after(path: Path, frames: int) -> None:
    """Keep the rows up to `frames`, without a row that was cut off while it was written."""
    if not path.exists():
        return
    whole, end, _ = path.read_text().rpartition("\n")
    if frames and not end:
        raise WriteError(f"{path} is damaged (no line is complete): move it away to continue")
    reader = csv.DictReader(whole.splitlines())
    try:
        kept = [row for row in reader if frames and int(row["frames"]) <= frames]
    except (KeyError, TypeError, ValueError) as error:
        raise WriteError(f"{path} is damaged ({error!r}): move it away to continue") from error
    if kept:
        write_atomically(path, _table(reader.fieldnames or [], kept, header=True))
    else:
        path.unlink()  # the next row writes the header
