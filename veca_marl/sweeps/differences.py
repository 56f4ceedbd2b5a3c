"""How the configuration of a run on disk differs from the one that is asked for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

_ABSENT = "absent"
_NUMBER = "number"  # of the elements of a list
_IGNORED = ("experiment", "resume")  # claims and seeds of an experiment do not change its runs
_DECIDED = "auto"  # such a value is decided when a run starts, and the run stores the decision

BY_TEAM = ("team", "opponent", "init_from", "init_encoders", "learner", "team_intrinsic")
"""Mappings from the names of teams."""
_BY_ACTION = "entropy_coefficient"  # of any algorithm: mapping from the parts of an action


@dataclass(frozen=True)
class Difference:
    """One key with two values.

    Attributes:
        key: Dotted path.
        stored: Value of the run; ``absent`` if it has none.
        asked: Value that is asked for; ``absent`` if there is none.
        of_version: Whether only one of both knows the key: it was added or removed between
            versions.
    """

    key: str
    stored: Any
    asked: Any
    of_version: bool = False

    def __str__(self) -> str:
        return f"{self.key} is {self.stored} in the run, {self.asked} is asked for"


def differences(stored: Mapping[str, Any], asked: Mapping[str, Any]) -> list[Difference]:
    """Return all keys with different values, in alphabetical order.

    A value ``auto`` that is asked for differs from no other value.

    Args:
        stored: Configuration of a run as plain data, in the form of this version.
        asked: The resolved configuration as plain data.
    """
    before, now = dict(_flat(stored)), dict(_flat(asked))
    return [
        Difference(
            key,
            before.get(key, _ABSENT),
            now.get(key, _ABSENT),
            of_version=not (_knows(before, key) and _knows(now, key)),
        )
        for key in sorted({*before, *now})
        if key.partition(".")[0] not in _IGNORED
        and now.get(key, _ABSENT) not in (before.get(key, _ABSENT), _DECIDED)
    ]


def _knows(flat: Mapping[str, Any], key: str) -> bool:
    """Return whether the version of a configuration has a key, with this value or another.

    It also has the key if there is a single value in place of a mapping or a mapping in place of a
    single value, and if a mapping from names, see `_maps_names`, has other names.

    Args:
        flat: Values by dotted path.
        key: Dotted path.
    """
    parts = key.split(".")
    above = {".".join(parts[:count]) for count in range(1, len(parts) + 1)}
    if above & flat.keys() or _has_below(flat, key):
        return True
    return any(
        _has_below(flat, mapping) and not _has_below(flat, _named(mapping, key))
        for mapping in filter(_maps_names, above)
    )


def _maps_names(path: str) -> bool:
    """Return whether the keys of a mapping are names of the user's game, not of this version."""
    return path in BY_TEAM or path.rpartition(".")[2] == _BY_ACTION


def _has_below(flat: Mapping[str, Any], path: str) -> bool:
    return any(key.startswith(f"{path}.") for key in flat)


def _named(mapping: str, key: str) -> str:
    """Return the path of the name in a mapping that a dotted path leads through."""
    name = key.removeprefix(f"{mapping}.").partition(".")[0]
    return f"{mapping}.{name}"


def key_patterns(keys: Iterable[str]) -> list[str]:
    """Return the distinct keys with ``*`` in place of the index of a list's element."""
    plain = (key.removesuffix(f".{_NUMBER}") for key in keys)
    return sorted({re.sub(r"\.\d+(?=\.|$)", ".*", key) for key in plain})


def _flat(node: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted paths and values; mappings in a list have their index as a name.

    The number of a list's elements is a value of its own: an element that only one list has is a
    difference, unlike a key that another version does not have.
    """
    for name, value in node.items():
        key = f"{path}.{name}".lstrip(".")
        if isinstance(value, Mapping) and value:
            yield from _flat(value, key)
            continue
        if isinstance(value, list):
            yield f"{key}.{_NUMBER}", len(value)
        if isinstance(value, list) and any(isinstance(each, Mapping) for each in value):
            yield from _flat({str(index): each for index, each in enumerate(value)}, key)
        else:
            yield key, value
