"""Senses, and the specs of the arrays that they observe."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray


class SpecError(ValueError):
    """A sense or a task has returned other names, shapes or types than it declares."""


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


class Versioned(Protocol):
    """What a sense needs to know of a `World` to tell one state from the next.

    Attributes:
        version: Changes whenever the world is stepped, reset or refreshed.
    """

    version: int


class Sense(ABC):
    """One modality of one body: numpy in, numpy out.

    A subclass implements `compute` and is constructed as ``Sense(cfg, body, world)``. It may keep
    state between steps (the samples heard last, for example), but shares none with other senses:
    neither the order in which senses are read nor their number changes a value.

    Attributes:
        cfg_type: The dataclass of its settings.
        specs: Observation name to its spec, known before the first read. Most senses have one
            entry under their own name; extras on request (`depth`, `waveform`) are further entries.
    """

    cfg_type: ClassVar[type[Any]]
    specs: dict[str, ArraySpec]

    def __init__(self, world: Versioned) -> None:
        """Remember the world, the version of which decides when values are recomputed.

        Args:
            world: The `World` of the body.
        """
        self._versioned = world
        self._computed_at: int | None = None
        self._values: dict[str, NDArray[Any]] = {}

    def reset(self) -> None:
        """Discard the state of the last episode.

        Call it after the world was reset and its bodies were placed, before `World.refresh`.
        """
        self._computed_at = None

    def read(self) -> dict[str, NDArray[Any]]:
        """Return the observation of the world's present state.

        The first call after a step, a reset or a refresh of the world computes the values; further
        calls return the same ones at no cost. A step in which a sense is not read costs nothing;
        each sense documents what it returns afterwards.

        Returns:
            A new dictionary with an array for each name in `specs`. The arrays are read-only and
            are not overwritten by later reads.

        Raises:
            SpecError: If `compute` has returned other names, shapes or types than in `specs`.
        """
        version = self._versioned.version
        if self._computed_at != version:
            values = self.compute()
            self._check(values)
            for array in values.values():
                array.flags.writeable = False
            self._values, self._computed_at = values, version
        return dict(self._values)

    def _check(self, values: Any) -> None:
        """Check what `compute` has returned: libraries cast and broadcast arrays without a word."""
        name = type(self).__name__
        if not isinstance(values, dict) or values.keys() != self.specs.keys():
            found = sorted(values) if isinstance(values, dict) else type(values).__name__
            raise SpecError(
                f"sense {name}: compute() returned {found}, its specs are {list(self.specs)}"
            )
        for key, spec in self.specs.items():
            check_spec(f"sense {name}: {key!r}", values[key], spec)

    @abstractmethod
    def compute(self) -> dict[str, NDArray[Any]]:
        """Compute the observation. `read` calls it at most once per version of the world.

        Returns:
            A newly allocated array for each name in `specs`.
        """


def check_spec(name: str, value: Any, spec: ArraySpec) -> None:
    """Compare an observation with its spec.

    Raises:
        SpecError: If it is no array, or its shape or dtype differ.
    """
    if not isinstance(value, np.ndarray):
        raise SpecError(
            f"{name} is of type {type(value).__name__}, not an array of "
            f"{np.dtype(spec.dtype)}{spec.shape}"
        )
    if value.shape != spec.shape or value.dtype != spec.dtype:
        raise SpecError(
            f"{name} is {value.dtype}{value.shape}, its spec says "
            f"{np.dtype(spec.dtype)}{spec.shape}"
        )
