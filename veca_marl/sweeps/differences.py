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


@dataclass(frozen=True)
class Difference:
    """One key with two values.

    Attributes:
        key: Dotted path.
        stored: Value of the run; ``absent`` if it has none.
        asked: Value that is asked for; ``absent`` if there is none.
    """

    key: str
    stored: Any
    asked: Any

    @property
    def of_version(self) -> bool:
        """Whether only one of both has the key: it was added or removed between versions."""
        return _ABSENT in (self.stored, self.asked)

    def __str__(self) -> str:
        return f"{self.key} is {self.stored} there and {self.asked} here"


def differences(
    stored: Mapping[str, Any], asked: Mapping[str, Any], former: Mapping[str, Any] | None = None
) -> list[Difference]:
    """Return all keys with different values, in alphabetical order.

    A value ``auto`` that is asked for differs from no other value.

    Args:
        stored: Content of ``config.yaml`` of a run as plain data.
        asked: The resolved configuration as plain data.
        former: Values of keys that `stored` may be too old to have, by dotted path, see
            `veca_marl.sweeps.former`.
    """
    one, other = dict(_flat(former or {})) | dict(_flat(stored)), dict(_flat(asked))
    return [
        Difference(key, one.get(key, _ABSENT), other.get(key, _ABSENT))
        for key in sorted({*one, *other})
        if key.partition(".")[0] not in _IGNORED
        and other.get(key, _ABSENT) not in (one.get(key, _ABSENT), _DECIDED)
    ]


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
