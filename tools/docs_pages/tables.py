"""Markdown tables, and the table of the fields of a configuration dataclass."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from enum import Enum
from typing import Any, get_args, get_origin, get_type_hints

from tools.docs_pages.docstrings import attributes

UNITS = {  # the last part of a field's name
    "m": "m",
    "m2": "m²",
    "s": "s",
    "mps": "m/s",
    "mps2": "m/s²",
    "kg": "kg",
    "deg": "°",
    "degps": "°/s",
    "rad": "rad",
    "hz": "Hz",
    "db": "dB",
    "n": "N",
    "nm": "N m",
    "ns": "N s",
    "seconds": "s",
    "minutes": "min",
    "months": "months",
    "frames": "frames",
}


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + [
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows
    ]


def field_table(cfg_type: type, leave_out: Sequence[str] = (), cfg: object = None) -> list[str]:
    """Return field, unit, default and meaning of a configuration, one row per field.

    Args:
        cfg_type: Its dataclass.
        leave_out: Fields without a row.
        cfg: A composed configuration; its values replace the defaults of the dataclass, which
            presets can change.
    """
    meanings = attributes(cfg_type)
    hints = get_type_hints(cfg_type)
    rows = [
        (
            f"`{field.name}`",
            unit(field.name),
            default(getattr(cfg, field.name, default_value(field)), hints[field.name]),
            meanings.get(field.name, ""),
        )
        for field in dataclasses.fields(cfg_type)
        if field.name not in leave_out
    ]
    return table(("field", "unit", "default", "meaning"), rows)


def unit(name: str) -> str:
    """Return the unit that the suffix of a field's name states; empty for none."""
    return UNITS.get(name.rpartition("_")[2], "")


def default_value(field: dataclasses.Field[Any]) -> Any:
    """Return a field's default; ``MISSING`` without one."""
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def default(value: Any, hint: Any) -> str:
    """Return a default as code, with the choices of an enumeration."""
    if value is dataclasses.MISSING or value == "???":
        return "required"
    enum = enumeration(hint)
    if isinstance(value, Enum) and enum is not None:
        others = ", ".join(f"`{choice.name}`" for choice in enum if choice is not value)
        return f"`{value.name}` (or {others})"
    return f"`{text(value)}`"


def text(value: Any) -> str:
    """Return a value as it is written on the command line."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Enum):
        return str(value.name)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(text(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{text(k)}: {text(v)}" for k, v in value.items()) + "}"
    return str(value) if value != "" else '""'


def enumeration(hint: Any) -> type[Enum] | None:
    """Return the enumeration in a type hint, also in ``Kind | None``."""
    kinds = get_args(hint) if get_origin(hint) else (hint,)
    found = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Enum)]
    return found[0] if found else None
