"""What an array looks like before it is read."""

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
    """

    shape: tuple[int, ...]
    dtype: DTypeLike
    low: float = -np.inf
    high: float = np.inf
