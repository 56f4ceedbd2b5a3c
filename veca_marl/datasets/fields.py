"""The arrays of a data set: name, type, range, unit and meaning."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

DTYPES = ("uint8", "int64", "float32")
"""Types that are stored."""


class Role(Enum):
    """What an array is to a learner: it reads inputs, predicts labels and may use the others."""

    input = "input"
    label = "label"
    extra = "extra"


@dataclass(frozen=True)
class Field:
    """One array of every sample.

    Attributes:
        shape: Its shape in one sample.
        dtype: One of `DTYPES`.
        role: See `Role`.
        low: Least possible value.
        high: Greatest possible value.
        unit: Unit of its values.
        meaning: One line.
        names: Names of its classes, or of the elements of a vector; empty if they have none.
    """

    shape: tuple[int, ...]
    dtype: str
    role: Role
    low: float
    high: float
    unit: str
    meaning: str
    names: tuple[str, ...] = ()

    @property
    def n_bytes(self) -> int:
        """Bytes of one sample."""
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize

    def check(self, name: str, value: NDArray[Any]) -> None:
        """Compare an array of one sample with this field.

        Raises:
            ValueError: If its shape or type differ, or a value is out of its range.
        """
        if value.shape != self.shape or value.dtype != np.dtype(self.dtype):
            raise ValueError(
                f"field {name!r}: {value.dtype}{value.shape}, not {self.dtype}{self.shape}"
            )
        if value.size and not (value.min() >= self.low and value.max() <= self.high):
            raise ValueError(
                f"field {name!r}: values from {value.min()} to {value.max()}, outside of "
                f"{self.low:g} to {self.high:g}"
            )

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, numbers and texts; an infinite bound is null."""
        plain = asdict(self) | {"role": self.role.value}
        for bound in ("low", "high"):
            plain[bound] = plain[bound] if math.isfinite(plain[bound]) else None
        return plain | {"shape": list(self.shape), "names": list(self.names)}

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Field:
        """Return the field that `to_dict` was called on.

        Raises:
            ValueError: If it is something else.
        """
        try:
            shape, low, high = tuple(plain["shape"]), plain["low"], plain["high"]
            made = cls(
                shape=shape,
                dtype=plain["dtype"],
                role=Role(plain["role"]),
                low=-math.inf if low is None else float(low),
                high=math.inf if high is None else float(high),
                unit=str(plain["unit"]),
                meaning=str(plain["meaning"]),
                names=tuple(map(str, plain["names"])),
            )
        except (KeyError, TypeError) as error:
            raise ValueError(f"no description of a field: {error!r}") from error
        if made.dtype not in DTYPES or not all(type(size) is int and size > 0 for size in shape):
            raise ValueError(f"no field has the type {made.dtype!r:.40} and shape {shape!r:.40}")
        return made
