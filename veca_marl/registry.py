"""Registries: named entries that the package and its plug-ins add when they are imported."""

from __future__ import annotations

import difflib
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from typing import Generic, TypeVar

Entry = TypeVar("Entry")


class Registry(Mapping[str, Entry], Generic[Entry]):
    """A mapping from names to entries in which each name occurs once.

    Args:
        kind: What the entries are, in the singular; used in error messages.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._entries: dict[str, Entry] = {}
        self._listeners: list[Callable[[str], None]] = []

    def __getitem__(self, name: str) -> Entry:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __setitem__(self, name: str, entry: Entry) -> None:
        self.add(name, entry)

    def __delitem__(self, name: str) -> None:
        del self._entries[name]

    def add(self, name: str, entry: Entry) -> None:
        """Add an entry, and call the listeners with its name.

        An entry that is defined again at the same place (a notebook cell that is executed twice)
        replaces the earlier one.

        Raises:
            ValueError: If another entry has this name; the message names both definitions.
        """
        present = self._entries.get(name)
        if present is not None and origin(present) != origin(entry):
            raise ValueError(
                f"{self.kind} {name!r} is defined twice: by {origin(present)} and {origin(entry)}"
            )
        self._entries[name] = entry
        for listener in self._listeners:
            listener(name)

    def find(self, name: str) -> Entry:
        """Return the entry with this name.

        Raises:
            ValueError: If there is none; the message lists the names.
        """
        try:
            return self._entries[name]
        except KeyError:
            raise ValueError(unknown(self.kind, name, self._entries)) from None

    def listen(self, listener: Callable[[str], None]) -> None:
        """Call `listener` with the name of each entry, the present and the later ones."""
        self._listeners.append(listener)
        for name in list(self._entries):
            listener(name)


def origin(entry: object) -> str:
    """Return the dotted name of a class or function, or that of the class of another object."""
    named = entry if hasattr(entry, "__qualname__") else type(entry)
    return f"{getattr(named, '__module__', '?')}.{getattr(named, '__qualname__', '?')}"


def import_modules(package: str, folders: Iterable[str]) -> None:
    """Import all modules of a package, so that what they define is registered.

    Args:
        package: Its dotted name.
        folders: Its ``__path__``.
    """
    for module in sorted(info.name for info in pkgutil.walk_packages(folders, f"{package}.")):
        import_module(module)


def unknown(kind: str, name: str, choices: Mapping[str, object] | list[str]) -> str:
    """Return the message for a name that does not exist, with the nearest and all choices."""
    near = difflib.get_close_matches(name, list(choices), n=1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"unknown {kind} {name!r}{hint}; choices: {', '.join(sorted(choices))}"
