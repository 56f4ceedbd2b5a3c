"""The objects of a game that exist when it has been built, and the classes that it may name.

A walk along the attributes of a game finds them in a fixed order: they have the same numbers in
every game of an equal configuration, in every process.
"""

from __future__ import annotations

import functools
import inspect
import logging
import sys
import types
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from typing import Any

import numpy as np

from veca_marl.sim.physics.bullet_client import BulletClient

PLAIN = (type(None), bool, int, float, str)
# have no content of their own
ATOMS = (bytes, Enum, range, slice, np.generic, np.dtype)
# have a content that is captured elsewhere, or none that changes: only those that were built
OPAQUE: tuple[type, ...] = (
    BulletClient, logging.Logger, type, types.FunctionType, types.BuiltinFunctionType,
    types.ModuleType, functools.partial,
)  # fmt: skip
_OWN = __name__.partition(".")[0]
# packages of which a state names no classes
_FOREIGN = {"builtins", "collections", "functools", "numpy"}


class SnapshotError(ValueError):
    """A state cannot be captured, stored, read or put back; the message is one line."""


class BuiltObjects:
    """All objects that can be reached from a root, in a fixed order.

    Args:
        root: The object from which the walk begins.

    Attributes:
        objects: The root, and the others in the order in which they were found.
    """

    def __init__(self, root: object) -> None:
        # with itself, since the root may have it as an attribute
        self.objects = [*_reachable(root), self]
        self._numbers = {id(each): number for number, each in enumerate(self.objects)}

    def number(self, item: object) -> int | None:
        """Return the number of an object; None if it is not one of these."""
        return self._numbers.get(id(item))

    def shared_with(self, other: BuiltObjects) -> frozenset[int]:
        """Return the numbers of the objects that two games of one configuration have in common.

        These are constants: games do not influence each other.

        Raises:
            SnapshotError: If the two were not built alike.
        """
        kinds = [[type(each) for each in one.objects] for one in (self, other)]
        if kinds[0] != kinds[1]:
            raise SnapshotError("two games of one configuration were not built alike")
        pairs = enumerate(zip(self.objects, other.objects, strict=True))
        return frozenset(number for number, (one, two) in pairs if one is two)


def _reachable(root: object) -> Iterator[object]:
    """Yield all objects that have a content, each once, breadth first."""
    found, waiting = {id(root)}, deque([root])
    while waiting:
        item = waiting.popleft()
        yield item
        for part in parts_of(item):
            if not isinstance(part, (*PLAIN, *ATOMS)) and id(part) not in found:
                found.add(id(part))
                waiting.append(part)


def parts_of(item: Any) -> Iterable[object]:
    """Return the objects that an object consists of."""
    if isinstance(item, (*OPAQUE, BuiltObjects, np.random.Generator)):
        return []
    if isinstance(item, np.ndarray):
        return [item.base] if isinstance(item.base, np.ndarray) else []
    if isinstance(item, Mapping):
        return [part for pair in item.items() for part in pair]
    if isinstance(item, (list, tuple, set, frozenset, deque)):
        return item
    if isinstance(item, types.MethodType):
        return [item.__self__]
    return [value for _, value in attributes(item)]


def attributes(item: object) -> Iterator[tuple[str, object]]:
    """Yield the names and values of all attributes of an object, with those in slots."""
    yield from getattr(item, "__dict__", {}).items()
    for one in type(item).__mro__:
        slots = one.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(item, name):
                yield name, getattr(item, name)


class KnownNames:
    """The classes that a state may name, and the methods that it may hold.

    Classes are those defined in the packages of a game; of this package, in the parts that the game
    consists of. What a module has imported from elsewhere is not among them. Functions have no
    names: those that a game was built with are among its built objects.

    Args:
        built: The objects of the game when it was built.
    """

    def __init__(self, built: BuiltObjects) -> None:
        self._types = {type(each) for each in built.objects}
        self._packages = {_package(each.__module__) for each in self._types} - _FOREIGN

    def find(self, name: str) -> type:
        """Return the class that is called `module:name`.

        Raises:
            SnapshotError: If there is none in the packages.
        """
        module, _, path = str(name).partition(":")
        found: Any = None
        if _package(module) in self._packages:
            found = sys.modules.get(module)
            for part in path.split("."):
                found = None if found is None else inspect.getattr_static(found, part, None)
        if not isinstance(found, type) or name_of(found) != name:
            raise SnapshotError(f"{name} is no class of {sorted(self._packages)}")
        return found

    def method(self, owner: object, name: str) -> types.MethodType:
        """Return a method of an object; what is no method, such as a property, is not called.

        Raises:
            SnapshotError: If the game was built without objects of its class, or the class has no
                such method.
        """
        function = inspect.getattr_static(type(owner), str(name), None)
        if type(owner) not in self._types or not isinstance(function, types.FunctionType):
            raise SnapshotError(f"{type(owner).__name__}.{name} is no method of the game")
        return types.MethodType(function, owner)


def _package(module: str) -> str:
    """Return the package of a module by which it is known; of this package, the part of it."""
    names = module.split(".")
    return ".".join(names[:2]) if names[0] == _OWN else names[0]


def name_of(item: type) -> str:
    """Return the name of a class, as `KnownNames` finds it."""
    return f"{item.__module__}:{item.__qualname__}"
