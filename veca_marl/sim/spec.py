"""Shape, type and range of an array, known before the array exists."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike


@dataclass(frozen=True)
class ArraySpec:
    """Shape, type and range of an array.

    Attributes:
        shape: Shape without any batch or agent dimension.
        dtype: numpy dtype.
        low: Least possible value; ``-inf`` when unbounded.
        high: Greatest possible value; ``inf`` when unbounded.
        names: For error messages and documentation: the names of a vector's elements, or of the
            choices of a discrete value; empty if they have none.
    """

    shape: tuple[int, ...]
    dtype: DTypeLike
    low: float = -np.inf
    high: float = np.inf
    names: tuple[str, ...] = ()

    @property
    def is_discrete(self) -> bool:
        """Whether this is one choice among ``high + 1``: an integer without shape."""
        return self.shape == () and np.issubdtype(self.dtype, np.integer)


def discrete_spec(names: tuple[str, ...]) -> ArraySpec:
    """Return the spec of one choice among named ones: shape ``()``, int64, from 0."""
    return ArraySpec((), np.int64, 0, len(names) - 1, names)


def continuous_spec(names: tuple[str, ...]) -> ArraySpec:
    """Return the spec of a vector of named numbers in [-1, 1], float32."""
    return ArraySpec((len(names),), np.float32, -1.0, 1.0, names)
