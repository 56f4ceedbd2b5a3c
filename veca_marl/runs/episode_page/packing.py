"""Arrays as compressed bytes that a browser unpacks with `DecompressionStream`.

Integers that change slowly over time are stored as differences along the first axis, the bytes of
equal significance together, which `deflate` compresses several times better than the values.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

DELTA, PLAIN, RAW = "delta", "plain", "raw"
_PLAIN_TYPES = ("uint8", "uint16", "int32", "float32")
_LARGEST = 2**31 - 1
_MOST_VALUES = 10**8  # of one array that is read


class PackingError(ValueError):
    """Bytes are not those of an array; the message is one line with the reason."""


class Packer:
    """Collects arrays and media in one block of bytes, and says where each of them is."""

    def __init__(self) -> None:
        self.entries: dict[str, dict[str, Any]] = {}
        self._parts: list[bytes] = []
        self._size = 0

    @property
    def block(self) -> bytes:
        """All bytes one after the other."""
        return b"".join(self._parts)

    def add_quantised(self, name: str, values: Array, unit: float) -> None:
        """Add ``(N, ...)`` numbers as multiples of `unit`, as differences along the first axis."""
        steps = np.rint(np.asarray(values, np.float64) / unit)
        if not np.isfinite(steps).all() or np.abs(steps).max(initial=0.0) > _LARGEST / 2:
            raise ValueError(f"{name}: values must be finite and below {_LARGEST / 2 * unit:g}")
        tracks = math.prod(steps.shape[1:])
        integers = steps.astype(np.int64).reshape(steps.shape[0], tracks)
        deltas = np.diff(integers, axis=0, prepend=0).astype("<i4")
        planes = np.ascontiguousarray(deltas.T).reshape(-1, 1).view(np.uint8).T
        entry = {"codec": DELTA, "unit": unit, "shape": list(np.shape(values))}
        self._add(name, entry, zlib.compress(planes.tobytes(), 9))

    def add_plain(self, name: str, values: Array) -> None:
        """Add an array of one of the types uint8, uint16, int32 and float32 as it is."""
        kind = values.dtype.name
        if kind not in _PLAIN_TYPES:
            raise ValueError(f"{name}: {kind} is none of {_PLAIN_TYPES}")
        entry = {"codec": PLAIN, "dtype": kind, "shape": list(values.shape)}
        little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        self._add(name, entry, zlib.compress(little.tobytes(), 9))

    def add_media(self, name: str, content: bytes) -> None:
        """Add a file that is compressed already: a picture or a sound."""
        self._add(name, {"codec": RAW}, content)

    def _add(self, name: str, entry: dict[str, Any], content: bytes) -> None:
        if name in self.entries:
            raise ValueError(f"{name} is there already")
        self.entries[name] = entry | {"at": self._size, "bytes": len(content)}
        self._parts.append(content)
        self._size += len(content)


def unpack(entries: Mapping[str, Mapping[str, Any]], block: bytes, name: str) -> Array:
    """Return an array that `Packer` stored; media as ``(bytes,)`` uint8.

    Args:
        entries: `Packer.entries`.
        block: `Packer.block`.
        name: Its name.

    Raises:
        PackingError: If there is none, or its bytes are not those of an array.
    """
    try:
        entry = entries[name]
        first, count = int(entry["at"]), int(entry["bytes"])
        if min(first, count) < 0 or first + count > len(block):
            raise PackingError(f"{name}: outside of the data")
        content = block[first : first + count]
        if entry["codec"] == RAW:
            return np.frombuffer(content, np.uint8)
        shape = tuple(int(size) for size in entry["shape"])
        if entry["codec"] == DELTA:
            return _accumulated(content, shape, float(entry["unit"]), name)
        if entry["codec"] != PLAIN or entry["dtype"] not in _PLAIN_TYPES:
            raise PackingError(f"{name}: of an unknown kind")
        kind = np.dtype(str(entry["dtype"])).newbyteorder("<")
        return np.frombuffer(_inflated(content, shape, kind.itemsize, name), kind).reshape(shape)
    except (KeyError, TypeError, ValueError, zlib.error) as error:
        raise PackingError(f"array {name!r}: {error}") from error


def _accumulated(content: bytes, shape: tuple[int, ...], unit: float, name: str) -> Array:
    planes = np.frombuffer(_inflated(content, shape, 4, name), np.uint8).reshape(4, -1)
    tracks = math.prod(shape[1:])
    deltas = np.ascontiguousarray(planes.T).view("<i4").reshape(tracks, shape[0]).T
    values: Array = np.cumsum(deltas.astype(np.int64), axis=0).reshape(shape) * unit
    return values


def _inflated(content: bytes, shape: tuple[int, ...], item_size: int, name: str) -> bytes:
    count = math.prod(shape)
    if min(shape, default=0) < 0 or count > _MOST_VALUES:
        raise PackingError(f"{name}: impossible shape {shape}")
    machine = zlib.decompressobj()
    data = machine.decompress(content, count * item_size + 1)
    if len(data) != count * item_size:
        raise PackingError(f"{name}: not the bytes of the shape {shape}")
    return data
