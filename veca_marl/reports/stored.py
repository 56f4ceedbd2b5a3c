"""Reads the files of a run and checks them, so that a damaged run is named and the others count."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from veca_marl.sweeps.run_state import StoredRun, read_run

_CONFIG_KEYS = ("task", "seed", "total_frames")  # of every version
_NUMBERS = {"evaluations": ("frames",), "metrics": ("frames", "frames_per_s")}
_WORDS = {"evaluations": ("player", "team"), "metrics": ()}


class DamagedRunError(ValueError):
    """A file of a run cannot be read; the message names the file and the reason."""


def read_checked_run(folder: Path) -> tuple[StoredRun, str]:
    """Return the run in a folder, which may be missing, and the commit that it was made with.

    The commit is the version of the package where it was installed, and empty where no
    ``provenance.json`` was written.

    Raises:
        DamagedRunError: If a file that a report reads is damaged.
    """
    with _read_errors(folder / "config.yaml"):
        run = read_run(folder)
        if run.config is None:
            return run, ""
        _check_keys(run.config)
    for kind, numbers in _NUMBERS.items():
        path = folder / f"{kind}.csv"
        with _read_errors(path):
            _check_table(path, numbers, _WORDS[kind])
    path = folder / "provenance.json"
    with _read_errors(path):
        return run, _commit(path)


@contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Turn errors of reading a file into one sentence that names it, or another file beside it."""
    try:
        yield
    except (ValueError, OSError, csv.Error) as error:
        reason = " ".join(str(error).split())
        named = str(path.parent) in reason
        raise DamagedRunError(reason if named else f"{path}: {reason}") from error


def _check_keys(config: dict[str, Any]) -> None:
    # keys that are absent count as those of another version: a file that was cut off would pass
    absent = [key for key in _CONFIG_KEYS if key not in config]
    if absent:
        raise ValueError(f"no key {absent[0]!r}")


def _check_table(path: Path, numbers: Sequence[str], words: Sequence[str]) -> None:
    """Check that a table has its columns, complete rows and numbers.

    Args:
        path: The CSV file, which may be missing.
        numbers: Columns with a number in each row.
        words: Columns without numbers; all others have a number or nothing.
    """
    if not path.is_file():
        return
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        columns = reader.fieldnames or ()
        rows: list[dict[Any, Any]] = list(reader)
    absent = [name for name in (*numbers, *words) if name not in columns]
    if absent:
        raise ValueError(f"no column {absent[0]!r}")
    if rows and None in rows[-1].values():
        rows.pop()  # a run is writing it, or was ended in the middle
    for number, row in enumerate(rows, start=1):
        _check_row(row, f"row {number}", numbers, words)


def _check_row(
    row: dict[Any, Any], name: str, numbers: Sequence[str], words: Sequence[str]
) -> None:
    if None in row or None in row.values():
        raise ValueError(f"{name} has another number of cells than the head")
    for column, cell in row.items():
        if column not in words and (cell or column in numbers):
            _check_number(cell, f"{name}, column {column!r}", whole=column == "frames")


def _check_number(cell: str, name: str, whole: bool) -> None:
    try:
        int(cell) if whole else float(cell)
    except ValueError:
        raise ValueError(f"{name}: {cell!r} is not a {'whole ' * whole}number") from None


def _commit(path: Path) -> str:
    if not path.is_file():
        return ""
    stored = json.loads(path.read_text())
    if not isinstance(stored, dict):
        raise ValueError("holds no object")
    packages = stored.get("packages")
    version = packages.get("veca_marl") if isinstance(packages, dict) else None
    if not (commit := stored.get("commit") or version):
        raise ValueError("names neither a commit nor a version of veca_marl")
    return str(commit)
