"""Files of unknown origin: read within limits, and checked before they are used.

A file may be damaged, or made so that reading it takes all memory, never ends, or executes code.
Each function reads plain files only (a pipe would be waited for), up to a size, and raises
`StoredFileError` with one line that names the file, whatever is in it.
"""

from __future__ import annotations

import csv
import json
import os
import re
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import yaml

MEGABYTE = 10**6
_LARGEST_YAML = 256_000  # bytes; the configuration of a run has 15 000
_LARGEST_JSON = 16 * MEGABYTE
_LARGEST_TEXT = 1000 * MEGABYTE
_LARGEST_TABLE = 256 * MEGABYTE  # a million batches of a run have as many
_LARGEST_WHOLE = 2**64
_MOST_VALUES = 20_000  # of a YAML file, whose values are read one after the other
_DEEPEST = 30  # nested lists and mappings


class StoredFileError(ValueError):
    """A stored file cannot be read; the message is one line with the file and the reason."""

    def __init__(self, path: Path, reason: object) -> None:
        super().__init__(f"{path} is damaged or cannot be read: {' '.join(str(reason).split())}")


def read_bytes(path: Path, limit: int) -> bytes:
    """Return the content of a plain file.

    Args:
        path: The file.
        limit: Bytes that it may have at most.

    Raises:
        StoredFileError: If there is no such file, it is larger, or it is a folder, a pipe, ...
    """
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with open(handle, "rb") as file:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise StoredFileError(path, "it is no plain file")
            content = file.read(limit + 1)
    except OSError as error:
        raise StoredFileError(path, error.strerror or error) from error
    if len(content) > limit:
        raise StoredFileError(path, f"it has more than {limit / MEGABYTE:g} MB")
    return content


def read_text(path: Path, limit: int = _LARGEST_TEXT) -> str:
    """Return the content of a text file in UTF-8; see `read_bytes`."""
    try:
        return read_bytes(path, limit).decode()
    except UnicodeDecodeError as error:
        raise StoredFileError(path, error) from error


def read_json(path: Path) -> dict[str, Any]:
    """Return the content of a JSON file, which has to be an object.

    Raises:
        StoredFileError: If it cannot be read, or holds no object.
    """
    text = read_text(path, _LARGEST_JSON)
    try:
        content = json.loads(text)
    except RecursionError as error:
        raise StoredFileError(path, "it is nested too deeply") from error
    except ValueError as error:  # also of a number with thousands of digits
        raise StoredFileError(path, error) from error
    if not isinstance(content, dict):
        raise StoredFileError(path, f"it holds {_kind(content)}, and no object")
    return content


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the content of a YAML file, which has to be a mapping, as plain data.

    What no run stores is refused before anything is made of it: aliases, which can stand for more
    values than memory holds; tags, which name types; interpolations, which read the environment.

    Raises:
        StoredFileError: If it cannot be read, holds no mapping, or one of these.
    """
    text = read_text(path, _LARGEST_YAML)
    try:
        _check_events(path, text)
        content = yaml.load(text, Loader=_Loader)
    except StoredFileError:
        raise
    except (yaml.YAMLError, ValueError, OverflowError, AttributeError) as error:
        raise StoredFileError(path, error) from error
    if not isinstance(content, dict):
        raise StoredFileError(path, f"it holds no configuration, but {_kind(content)}")
    for key, value in _values(path, content):
        if isinstance(value, str) and "${" in value:
            raise StoredFileError(path, f"{key} is an interpolation: {value[:80]!r}")
    return content


def _kind(content: object) -> str:
    return "nothing" if content is None else f"a {type(content).__name__}"


_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same results, and ten times faster


class _Loader(_Base):  # type: ignore[misc]
    """Reads what OmegaConf writes: numbers like 1e-3 are numbers, dates are text."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping; a key that occurs twice is refused."""
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"found duplicate key {key.value!r}", problem_mark=key.start_mark
                )
            seen.add(key.value)
        made: dict[Any, Any] = super().construct_mapping(node, deep)
        return made


_DATE = "tag:yaml.org,2002:timestamp"
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != _DATE]
    for first, resolvers in _Base.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?[0-9]+(?:\.[0-9]*)?[eE][-+]?[0-9]+", re.ASCII),
    list("-+0123456789"),
)


def _check_events(path: Path, text: str) -> None:
    """Check a YAML text as it is parsed, before anything is made of it."""
    depth = values = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise StoredFileError(path, f"it has the alias {event.anchor!r}")
        if getattr(event, "tag", None) not in (None, "!"):
            raise StoredFileError(path, f"it has the tag {event.tag!r}")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        values += isinstance(event, yaml.NodeEvent)
        if depth > _DEEPEST:
            raise StoredFileError(path, f"it is nested more than {_DEEPEST} times")
        if values > _MOST_VALUES:
            raise StoredFileError(path, f"it has more than {_MOST_VALUES} values")


def _values(path: Path, node: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted path and the value of everything below a node; keys have to be text."""
    if isinstance(node, dict):
        for name, value in node.items():
            if not isinstance(name, str):
                raise StoredFileError(path, f"the key {name!r} is no text")
            yield from _values(path, value, f"{key}.{name}".lstrip("."))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from _values(path, value, f"{key}.{index}")
    else:
        yield key, node


Row = dict[str, str]
"""Cells of a row of a table by the names of their columns."""


@dataclass(frozen=True)
class Columns:
    """The columns of a CSV file that are known by name; all others have a number or nothing.

    Attributes:
        whole: Columns that have to be there, with a whole number in each row.
        numbers: Columns that have to be there, with a number in each row.
        words: Columns that have to be there, with words.
        may_be_whole: Columns that may be absent, with a whole number or nothing.
        may_be_words: Columns that may be absent, with words.
    """

    whole: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    may_be_whole: tuple[str, ...] = ()
    may_be_words: tuple[str, ...] = ()

    def check(self, path: Path, names: Iterable[str], rows: Iterable[Row]) -> None:
        """Check the head of a table and its cells.

        Raises:
            StoredFileError: If a column is absent, or a cell has something else.
        """
        known = set(names)
        for name in (*self.whole, *self.numbers, *self.words):
            if name not in known:
                raise StoredFileError(path, f"no column {name!r}")
        for number, row in enumerate(rows, start=1):
            for name, cell in row.items():
                if reason := self._reason(name, cell):
                    raise StoredFileError(path, f"row {number}, column {name!r}: {reason}")

    def _reason(self, name: str, cell: str) -> str:
        """Return why a column cannot have a cell; empty if it can."""
        if name in self.words or name in self.may_be_words:
            return ""
        if not cell and name not in self.whole and name not in self.numbers:
            return ""
        if name in self.whole or name in self.may_be_whole:
            return "" if _is_whole(cell) else f"{cell[:80]!r} is not a whole number"
        return "" if _is_number(cell) else f"{cell[:80]!r} is not a number"


def _is_whole(cell: str) -> bool:
    return cell.isdecimal() and len(cell) <= 20 and int(cell) < _LARGEST_WHOLE


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def read_table(path: Path, columns: Columns) -> list[Row]:
    """Return the rows of a CSV file.

    Raises:
        StoredFileError: If it cannot be read, has other columns or cells, or a row has another
            number of cells than the head.
    """
    names, rows = read_cells(path)
    return _complete(path, columns, names, rows)


def read_growing_table(path: Path, columns: Columns) -> list[Row]:
    """Return the rows of a CSV file to which a run appends, without a last one that is cut off.

    The run is writing it, or was ended in the middle.

    Raises:
        StoredFileError: See `read_table`.
    """
    names, rows = read_cells(path)
    if rows and None in rows[-1].values():
        rows.pop()
    return _complete(path, columns, names, rows)


def _complete(path: Path, columns: Columns, names: list[str], rows: list[Any]) -> list[Row]:
    for number, row in enumerate(rows, start=1):
        if None in row or None in row.values():
            raise StoredFileError(path, f"row {number} has another number of cells than the head")
    columns.check(path, names, rows)
    return rows


def read_cells(path: Path) -> tuple[list[str], list[dict[Any, Any]]]:
    """Return the head and the rows of a CSV file, whatever they are; see `cells_in`."""
    return cells_in(path, read_table_text(path))


def read_table_text(path: Path) -> str:
    """Return the text of a CSV file.

    Raises:
        StoredFileError: If it cannot be read, or is larger than any that a run writes.
    """
    return read_text(path, _LARGEST_TABLE)


def cells_in(path: Path, text: str) -> tuple[list[str], list[dict[Any, Any]]]:
    """Return the head and the rows in the text of a CSV file.

    Cells that a row lacks are None; what it has more than the head is a list beside the key None.

    Args:
        path: The file, for errors.
        text: Its text, or the beginning of it.

    Raises:
        StoredFileError: If it is no CSV, or has longer cells than `csv` reads.
    """
    reader = csv.DictReader(StringIO(text, newline=""))
    try:
        rows = list(reader)
    except csv.Error as error:
        raise StoredFileError(path, f"line {reader.line_num}: {error}") from error
    return list(reader.fieldnames or ()), rows
