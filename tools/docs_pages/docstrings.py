"""Read Google style docstrings: the prose, and the entries of one section."""

from __future__ import annotations

import inspect
import re

SECTION = re.compile(r"^([A-Z][A-Za-z ]+):$")
ENTRY = re.compile(r"^    (\w[\w ,.|\"`]*?): (.*)$")


def prose(documented: type) -> str:
    """Return a docstring up to its first section such as ``Attributes:``."""
    lines = inspect.cleandoc(documented.__doc__ or "").splitlines()
    ends = [i for i, line in enumerate(lines) if SECTION.match(line)]
    return "\n".join(lines[: ends[0]] if ends else lines).strip()


def entries(documented: type, section: str) -> dict[str, str]:
    """Return name to description of a section's entries, each in one line; empty without it."""
    lines = inspect.cleandoc(documented.__doc__ or "").splitlines()
    if f"{section}:" not in lines:
        return {}
    found: dict[str, str] = {}
    name = ""
    for line in lines[lines.index(f"{section}:") + 1 :]:
        if SECTION.match(line) or (line and not line.startswith("    ")):
            break
        match = ENTRY.match(line)
        if match and not line.startswith("     "):
            name, found[match[1]] = match[1], match[2]
        elif name and line.strip():
            found[name] += " " + line.strip()
    return found


def attributes(documented: type) -> dict[str, str]:
    """Return the documented attributes of a class and of the classes that it extends."""
    found: dict[str, str] = {}
    for parent in reversed(documented.__mro__):
        found |= entries(parent, "Attributes")
    return found
