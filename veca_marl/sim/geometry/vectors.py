"""Small vectors in compiled loops: tuples of numbers, which need no allocation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

Vector: TypeAlias = tuple[float, float, float]

# a number in single precision; to the type checker a float like any other
single = cast(Callable[[float], float], np.float32)


def horizontal_distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the distance between two points ``(2,)`` or ``(3,)`` on the floor plan, metres."""
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))
