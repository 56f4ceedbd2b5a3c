"""The argument of a command that continues a run, as Hydra and a shell read it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

_PLAIN = re.compile(r"[\w./-]*/[\w./-]*", re.ASCII)  # a single word may be a number, or null


def resume_argument(path: str | Path) -> str:
    """Return what continues the run in a folder, to be copied into a shell."""
    value = str(path) if _PLAIN.fullmatch(str(path)) else quoted(path)
    return shlex.quote(f"resume={value}")


def quoted(path: str | Path) -> str:
    """Return a path as a quoted word of Hydra's grammar.

    In it a backslash is one, except before a quotation mark.
    """
    escaped = re.sub(r"(\\*)'", r"\1\1\\'", str(path))
    escaped = re.sub(r"(\\+)$", r"\1\1", escaped)
    return f"'{escaped}'"
