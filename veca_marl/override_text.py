"""Overrides as text: paths and numbers, written so that Hydra's grammar reads what was meant.

This module imports nothing of the package, so that commands can use it before anything is loaded.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

_PATH = re.compile(r"(~|/|\./|\.\./)")
_PLAIN = re.compile(r"[\w./:@+ -]*", re.ASCII)  # read unchanged without quotation marks
_EXPONENT = re.compile(r"[+-]?\d+(\.\d*)?[eE]\+?\d+")


def is_within(key: str, parts: Iterable[str]) -> bool:
    """Return whether a dotted key is one of some parts of a configuration, or in one of them."""
    return any(key == part or key.startswith(f"{part}.") for part in parts)


def normalised(overrides: Sequence[str]) -> list[str]:
    """Write paths and integers in overrides so that they are read as what they are.

    - A value with a ``/`` that names an existing file or folder is its path, whatever characters it
      has; so is one that begins with ``/``, ``./``, ``../`` or ``~``, which becomes the home
      directory. A comma in others separates the values of a sweep: a path that does not exist yet
      is quoted by hand, ``"to='/data/a,b'"``. Lists, functions and quoted texts stay as they are.
    - An integral number in exponent notation (``total_frames=1e6``) gets digits only, which fields
      of type int accept as well as those of type float; so do the values of a sweep.

    Everything else stays as it is.
    """
    return [_normalised(text) for text in overrides]


def _normalised(text: str) -> str:
    key, equals, value = text.partition("=")
    if "/" in value and not _PLAIN.fullmatch(value) and _exists(value):
        return f"{key}={_path(value)}"
    parts = value.split(",")
    if not equals or not all(parts):
        return text
    if _PATH.match(value):  # a path, or several of a sweep; no list, function or quoted text
        written = [_path(part) if _PATH.match(part) else part for part in parts]
    else:
        written = [_integer(part) for part in parts]
    return f"{key}={','.join(written)}"


def _exists(text: str) -> bool:
    """Return whether a text names a file or folder, or one and a team in it: ``FOLDER:TEAM``."""
    path = os.path.expanduser(text)
    return os.path.lexists(path) or os.path.lexists(path.rpartition(":")[0])


def _path(text: str) -> str:
    path = os.path.expanduser(text)
    return path if _PLAIN.fullmatch(path) else quoted(path)


def _integer(text: str) -> str:
    if not _EXPONENT.fullmatch(text.strip()):
        return text
    number = float(text)
    return str(int(number)) if number.is_integer() else text


def quoted(path: str | Path) -> str:
    """Return a path as a quoted word of Hydra's grammar.

    In it a backslash is one, except before a quotation mark.
    """
    escaped = re.sub(r"(\\*)'", r"\1\1\\'", str(path))
    escaped = re.sub(r"(\\+)$", r"\1\1", escaped)
    return f"'{escaped}'"


_LONGEST_NAME = 200  # bytes; Linux allows 255


def short_name(name: str) -> str:
    """Return a name that file systems take: long ones end in a digest, the same every time."""
    content = name.encode()
    if len(content) <= _LONGEST_NAME:
        return name
    digest = hashlib.sha256(content).hexdigest()[:12]
    return f"{content[: _LONGEST_NAME - 13].decode(errors='ignore')}-{digest}"
