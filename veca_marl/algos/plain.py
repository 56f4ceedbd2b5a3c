"""Dataclasses of numbers to plain data and back: how a checkpoint stores a configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, TypeVar, get_type_hints

T = TypeVar("T")


def to_plain(value: Any) -> Any:
    """Return dictionaries, lists, numbers and strings; an Enum becomes its name."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {key: to_plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(entry) for entry in value]
    return value.name if isinstance(value, Enum) else value


def from_plain(kind: type[T], plain: dict[str, Any], find: Callable[[type, str], type]) -> T:
    """Return the dataclass that `to_plain` was given.

    Args:
        kind: Its type, or the base class of it.
        plain: What `to_plain` returned.
        find: Returns the type for a base class and the `name` that the plain data hold, for
            dataclasses that are chosen from a registry. If that type has an attribute
            `formerly`, it holds the values of fields that `plain` may be too old to have.

    Raises:
        ValueError: If a field is unknown.
    """
    actual = find(kind, plain["name"]) if "name" in plain else kind
    plain = getattr(actual, "formerly", {}) | plain
    hints = get_type_hints(actual)
    unknown = sorted(set(plain) - set(hints))
    if unknown:
        raise ValueError(f"{actual.__name__} has no fields {unknown}")
    values = {name: _restore(hints[name], value, find) for name, value in plain.items()}
    made: T = actual(**values)
    return made


def _restore(hint: Any, value: Any, find: Callable[[type, str], type]) -> Any:
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint[value]
    if is_dataclass(hint) and isinstance(hint, type):
        return from_plain(hint, value, find)
    return value
