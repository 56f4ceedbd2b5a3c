"""The contents of all objects of a game, as plain data that can be put back.

A game is a graph of Python objects. Those that exist when it has been built are numbered in the
order in which a walk along its attributes finds them: the same numbers in every game of an equal
configuration, in every process. A captured state has the content of each of them, and of the
objects that were made since then, in terms of numbers, text, arrays and references. Put back, what
was built keeps its identity, and what was made since is made again.

Nothing is executed when a state is put back: objects are made without their constructors, of
classes in packages that the game itself uses, and no attribute takes the place of a method. What is
no data (a generator function that runs, an iterator, an open file) is refused when a state is
captured.
"""

from __future__ import annotations

import functools
import inspect
import types
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from veca_marl.envs.core.built_objects import (
    ATOMS,
    OPAQUE,
    PLAIN,
    BuiltObjects,
    KnownNames,
    SnapshotError,
    attributes,
    name_of,
    parts_of,
)

Value = Any
"""None, bool, int, float, str, or a tuple that begins with the kind of what it stands for."""

_IMMUTABLE = (tuple, frozenset, types.MethodType, types.MappingProxyType)


@dataclass
class ObjectStates:
    """The contents of the objects of a game.

    Attributes:
        built: Content of each built object that can change, by its number.
        made: Contents of the objects that were made since.
    """

    built: dict[int, Value] = field(default_factory=dict)
    made: list[Value] = field(default_factory=list)


class Capture:
    """Captures the contents of all objects that can be reached from the first built one.

    Args:
        built: The objects of the game when it was built.
        constant: Numbers of those that never change.
    """

    def __init__(self, built: BuiltObjects, constant: frozenset[int]) -> None:
        self._built, self._constant = built, constant
        self._names = KnownNames(built)
        self._made: dict[int, int] = {}
        self._kept: list[object] = []  # an identity is that of another object after it is freed
        self._waiting: deque[tuple[bool, int, object]] = deque()
        self._seen: set[int] = set()
        self._states = ObjectStates()

    def states(self) -> ObjectStates:
        """Return the contents.

        Raises:
            SnapshotError: If an object is no data.
        """
        self._value(self._built.objects[0], "the game")
        while self._waiting:
            is_built, number, item = self._waiting.popleft()
            content = self._content(item)
            if is_built:
                self._states.built[number] = content
            else:
                self._states.made[number] = content
        return self._states

    def _value(self, item: Any, owner: str) -> Value:
        """Return what stands for an object; its content is captured later."""
        if type(item) in PLAIN:
            return item
        number = self._built.number(item)
        if number is not None:
            if number not in self._seen and number not in self._constant:
                self._seen.add(number)
                self._wait_for(number, item)
            return "built", number
        if isinstance(item, (*ATOMS, *OPAQUE)):
            return self._atom(item, owner)
        if id(item) not in self._made:
            self._check_is_data(item, owner)
            self._made[id(item)] = len(self._kept)
            self._waiting.append((False, len(self._kept), item))
            self._kept.append(item)
            self._states.made.append(None)
        return "made", self._made[id(item)]

    def _wait_for(self, number: int, item: Any) -> None:
        """Capture the content of a built object later; that of what cannot change is in parts."""
        if isinstance(item, _IMMUTABLE):
            self._values(parts_of(item), _class_name(item))
        elif not isinstance(item, (*OPAQUE, BuiltObjects)):
            self._waiting.append((True, number, item))

    def _values(self, items: Iterable[Any], owner: str) -> tuple[Value, ...]:
        return tuple(self._value(item, owner) for item in items)

    def _content(self, item: Any) -> Value:
        """Return the content of an object."""
        kind: type = type(item)
        name = _class_name(item)
        if kind is np.ndarray:
            return self._array(item)
        if kind in (dict, types.MappingProxyType):
            pairs = tuple(self._values(pair, name) for pair in item.items())
            return "dict" if kind is dict else "proxy", pairs
        if kind is deque:
            return "deque", item.maxlen, self._values(item, name)
        if kind in _CONTAINERS.values():
            return kind.__name__, self._values(item, name)
        if kind is types.MethodType:
            method = self._names.method(item.__self__, item.__func__.__name__)
            return "method", self._value(item.__self__, name), method.__name__
        if kind is np.random.Generator:
            return "random", _frozen(item.bit_generator.state)
        if isinstance(item, tuple):
            return "named", name_of(kind), self._values(item, name)
        held = ((key, self._value(value, f"{name}.{key}")) for key, value in attributes(item))
        return "object", name_of(kind), tuple(held)

    def _array(self, item: np.ndarray[Any, Any]) -> Value:
        if item.dtype.hasobject:
            raise SnapshotError("an array of Python objects is no data that a snapshot can have")
        if isinstance(item.base, np.ndarray):
            offset = item.__array_interface__["data"][0] - item.base.__array_interface__["data"][0]
            base = self._value(item.base, "ndarray")
            shape = item.dtype.str, item.shape, item.strides
            return "view", base, offset, shape, item.flags.writeable
        return "array", item.copy(), item.flags.writeable

    def _atom(self, item: Any, owner: str) -> Value:
        """Return what stands for an object without a content of its own."""
        if isinstance(item, Enum):
            return "enum", self._known_name(type(item), owner), item.name
        if isinstance(item, np.generic):
            return "scalar", item.dtype.str, item.item()
        if isinstance(item, np.dtype):
            return "dtype", item.str
        if isinstance(item, bytes):
            return "bytes", item.hex()
        if isinstance(item, (range, slice)):
            return type(item).__name__, item.start, item.stop, item.step
        if isinstance(item, type) and issubclass(item, np.generic):
            return "number_type", np.dtype(item).str
        if isinstance(item, type):
            return "class", self._known_name(item, owner)
        raise _no_data(item, owner)

    def _known_name(self, item: type, owner: str) -> str:
        """Return the name by which a class can be found again."""
        name = name_of(item)
        try:
            if self._names.find(name) is item:
                return name
        except SnapshotError as error:
            raise _no_data(item, owner) from error
        raise _no_data(item, owner)

    def _check_is_data(self, item: Any, owner: str) -> None:
        """Refuse objects that attributes alone do not describe, such as files and iterators."""
        kind = type(item)
        if kind in _WITH_CONTENT:
            return
        if isinstance(item, (dict, list, set, frozenset, deque, np.ndarray)):
            raise _no_data(item, owner)  # of a subclass: attributes would be kept, its items lost
        try:
            object.__new__(kind) if not isinstance(item, tuple) else None
        except TypeError:
            raise _no_data(item, owner) from None
        self._known_name(kind, owner)


def _no_data(item: object, owner: str) -> SnapshotError:
    return SnapshotError(f"{owner} holds {item!r:.80}, which is no data")


def _class_name(item: object) -> str:
    return type(item).__name__


def _frozen(state: Any) -> Value:
    """Return the state of a random generator as nested tuples."""
    if isinstance(state, Mapping):
        return "dict", tuple((key, _frozen(value)) for key, value in state.items())
    return state


def _thawed(state: Value) -> Any:
    if isinstance(state, (tuple, list)):
        return {key: _thawed(value) for key, value in state[1]}
    return state


def _bit_generator(state: Any) -> np.random.BitGenerator:
    """Return a new bit generator with a state."""
    kind = getattr(np.random, state["bit_generator"])
    if not (isinstance(kind, type) and issubclass(kind, np.random.BitGenerator)):
        raise SnapshotError(f"{state['bit_generator']!r} is no bit generator")
    generator: np.random.BitGenerator = kind()
    generator.state = state
    return generator


_CONTAINERS: dict[str, Callable[[Iterable[Any]], Any]] = {
    "list": list, "set": set, "tuple": tuple, "frozenset": frozenset,
}  # fmt: skip


class Putting:
    """Puts captured contents back into a game of the same configuration.

    Args:
        states: The contents.
        built: The objects of the game when it was built.

    Raises:
        SnapshotError: If the contents do not belong to a game that was built like this one. The
            game is as it was.
    """

    def __init__(self, states: ObjectStates, built: BuiltObjects) -> None:
        self._states, self._built = states, built
        self._made: dict[int, Any] = {}
        self._names = KnownNames(built)
        try:
            made = [(self._object(number), each) for number, each in enumerate(states.made)]
            present = [(built.objects[number], each) for number, each in states.built.items()]
            late = [(item, each) for item, each in made if each[0] not in _FILLED_AT_ONCE]
            # objects first: they may be keys of dictionaries, which need their hashes
            late.sort(key=lambda pair: pair[1][0] != "object")
            self._fillings = [self._filling(item, each) for item, each in late + present]
        except (LookupError, TypeError, ValueError, AttributeError, RecursionError) as error:
            if isinstance(error, SnapshotError):
                raise
            raise SnapshotError(f"the snapshot does not fit this game: {error}") from error

    def put(self) -> None:
        """Fill all objects."""
        for fill in self._fillings:
            fill()

    def _object(self, number: int) -> Any:
        """Return an object that is made again; what can be filled later is empty."""
        if number not in self._made:
            content = self._states.made[number]
            self._made[number] = self._new(content)
        return self._made[number]

    def _new(self, content: Value) -> Any:
        kind = content[0]
        if kind == "object":
            return object.__new__(self._names.find(content[1]))
        if kind in ("tuple", "frozenset"):
            return _CONTAINERS[kind](self._value(each) for each in content[1])
        if kind == "named":
            return tuple.__new__(self._names.find(content[1]), map(self._value, content[2]))
        if kind == "proxy":
            pairs = (map(self._value, pair) for pair in content[1])
            return types.MappingProxyType(dict(pairs))  # type: ignore[arg-type]
        if kind == "method":
            return self._names.method(self._value(content[1]), content[2])
        if kind == "array":
            array = content[1].copy()
            array.flags.writeable = content[2]
            return array
        if kind == "view":
            return self._view(content)
        if kind == "random":
            return np.random.Generator(_bit_generator(_thawed(content[1])))
        if kind == "deque":
            return deque(maxlen=content[1])
        return {"list": list, "dict": dict, "set": set}[kind]()

    def _view(self, content: Value) -> Any:
        _, base, offset, (dtype, shape, strides), writeable = content
        if np.dtype(dtype).hasobject:  # its bytes would be taken for addresses
            raise SnapshotError(f"a view has the dtype {dtype}")
        view = np.ndarray(shape, dtype, self._value(base), offset, strides)
        view.flags.writeable = writeable
        return view

    def _filling(self, item: Any, content: Value) -> Callable[[], None]:
        """Return what gives an object the content that was captured."""
        kind = content[0]
        if kind == "array":
            return self._filled_array(item, content[1])
        if kind == "view":
            return lambda: None
        if kind == "random":
            _check_kind(item, np.random.Generator)
            state = _thawed(content[1])
            _check_kind(item.bit_generator, type(_bit_generator(state)))
            return lambda: setattr(item.bit_generator, "state", state)
        if kind == "object":
            _check_kind(item, self._names.find(content[1]))
            values = {str(name): self._value(value) for name, value in content[2]}
            _check_attributes(type(item), values)
            return lambda: _set_attributes(item, values)
        _check_kind(item, {"list": list, "dict": dict, "set": set, "deque": deque}[kind])
        if kind == "dict":
            pairs = [tuple(map(self._value, pair)) for pair in content[1]]
            return lambda: _refill(item, item.update, pairs)
        parts = list(map(self._value, content[-1]))
        return lambda: _refill(item, item.update if kind == "set" else item.extend, parts)

    def _filled_array(self, item: Any, values: Any) -> Callable[[], None]:
        if not isinstance(item, np.ndarray) or not isinstance(values, np.ndarray):
            raise SnapshotError(f"the snapshot has an array for a {type(item).__name__}")
        if (item.shape, item.dtype) != (values.shape, values.dtype):
            raise SnapshotError(
                f"the snapshot has an array {values.dtype}{values.shape} for one of "
                f"{item.dtype}{item.shape}"
            )
        return lambda: np.copyto(item, values) if item.flags.writeable else None

    def _value(self, value: Value) -> Any:
        """Return the object that a value stands for."""
        if not isinstance(value, (tuple, list)):
            return value
        kind = value[0]
        if kind == "built":
            return self._built.objects[value[1]]
        if kind == "made":
            return self._object(value[1])
        if kind == "enum":
            return self._member(value[1], value[2])
        if kind == "scalar":
            return np.dtype(value[1]).type(value[2])
        if kind == "bytes":
            return bytes.fromhex(value[1])
        if kind == "class":
            return self._names.find(value[1])
        if kind == "number_type":
            return np.dtype(value[1]).type
        if kind == "dtype":
            return np.dtype(value[1])
        return {"range": range, "slice": slice}[kind](*value[1:])

    def _member(self, name: str, member: str) -> Enum:
        """Return a member of an enumeration."""
        found = self._names.find(name)
        if not issubclass(found, Enum):
            raise SnapshotError(f"{name} is no enumeration")
        return found[member]


_WITH_CONTENT = {
    np.ndarray, np.random.Generator, dict, deque, types.MappingProxyType, types.MethodType,
    *_CONTAINERS.values(),
}  # fmt: skip
_FILLED_AT_ONCE = ("array", "view", "tuple", "frozenset", "named", "proxy", "method")


def _check_kind(item: object, kind: type) -> None:
    if type(item) is not kind:
        raise SnapshotError(f"the snapshot has a {kind.__name__} for a {type(item).__name__}")


def _refill(item: Any, add: Callable[[Any], None], parts: Any) -> None:
    item.clear()
    add(parts)


def _check_attributes(kind: type, names: Iterable[str]) -> None:
    """Refuse attributes that would take the place of what a class defines, such as a method."""
    for name in names:
        defined = inspect.getattr_static(kind, name, None)
        is_data = isinstance(defined, (types.MemberDescriptorType, functools.cached_property))
        if not is_data and (callable(defined) or hasattr(defined, "__get__")):
            raise SnapshotError(f"the snapshot has an attribute for {kind.__name__}.{name}")


def _set_attributes(item: object, values: Mapping[str, Any]) -> None:
    """Set all attributes, and delete those that are not among them."""
    for name in {name for name, _ in attributes(item)} - values.keys():
        object.__delattr__(item, name)
    for name, value in values.items():
        object.__setattr__(item, name, value)
