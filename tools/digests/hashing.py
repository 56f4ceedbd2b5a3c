"""A hash of arrays, numbers and texts with their names."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

CHARACTERS = 16
"""Length of a digest, hexadecimal digits."""


class Item(Protocol):
    """Something whose bytes must not change."""

    @property
    def name(self) -> str:
        """Unique, with the kind before a slash."""

    def measure(self, digest: Digest) -> None:
        """Play or train, and add the results to a digest."""


class Digest:
    """SHA-256 of values in the order in which they are added."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, name: str, value: Any) -> None:
        """Add a value with its name.

        Args:
            name: Its name.
            value: An array or tensor, of which shape, type and bytes count; a number, a text, None;
                or a mapping or sequence of such values. A mapping counts in the order of its
                sorted keys.

        Raises:
            TypeError: If it is of another type, whose bytes are not defined.
        """
        if isinstance(value, Mapping):
            for key in sorted(value.keys(), key=str):
                self.add(f"{name}/{key}", value[key])
        elif isinstance(value, (list, tuple)):
            self._update(name, f"{len(value)} values", b"")
            for index, entry in enumerate(value):
                self.add(f"{name}/{index}", entry)
        elif isinstance(value, torch.Tensor):
            self._update(name, f"{value.dtype} {tuple(value.shape)}", _bytes(value))
        elif isinstance(value, (np.ndarray, np.generic)):
            self._add_array(name, np.asarray(value))
        elif value is None or isinstance(value, (bool, int, float, str)):
            self._update(name, type(value).__name__, repr(value).encode())
        else:
            raise TypeError(f"{name} is {type(value).__name__}, which has no bytes to compare")

    def _add_array(self, name: str, array: NDArray[Any]) -> None:
        self._update(name, f"{array.dtype} {array.shape}", array.tobytes())

    def _update(self, name: str, kind: str, content: bytes) -> None:
        self._hash.update(f"{name} {kind} {len(content)}\n".encode())
        self._hash.update(content)

    def text(self) -> str:
        """Return the first `CHARACTERS` digits."""
        return self._hash.hexdigest()[:CHARACTERS]


def _bytes(tensor: torch.Tensor) -> bytes:
    """Return the bytes of a tensor of any type, also of those that numpy does not have."""
    flat = tensor.detach().cpu().contiguous().reshape(-1)
    content: bytes = flat.view(torch.uint8).numpy().tobytes()
    return content
