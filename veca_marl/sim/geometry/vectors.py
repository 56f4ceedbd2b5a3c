"""Small vectors in compiled loops: tuples of numbers, which need no allocation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias, cast

import numpy as np

Vector: TypeAlias = tuple[float, float, float]

# a number in single precision; to the type checker a float like any other
single = cast(Callable[[float], float], np.float32)
