"""The interface of a data set: what a sample contains, and how the sample of an index is drawn."""

from __future__ import annotations

import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from veca_marl.datasets.fields import Field
from veca_marl.registry import Registry
from veca_marl.sim.physics import PlaygroundCfg
from veca_marl.sim.senses import SensesCfg

Sample = dict[str, NDArray[Any]]
"""An array for each field."""


TRIES = 10_000
"""Draws of a scene after which the settings are considered impossible."""


class NoSceneError(ValueError):
    """The settings of a data set leave no scene that shows what it has to show."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"{name}: none of {TRIES} scenes shows what it has to show; allow more distances, "
            "larger things or fewer least pixels or steps"
        )


@dataclass
class DatasetCfg:
    """Base class of the numbers of a data set.

    Attributes:
        name: Name of the data set in the registry.
    """

    name: str = ""

    def check_range(self, name: str, low: float, high: float) -> None:
        """Check a pair of numbers from which values are drawn.

        Args:
            name: The field that holds the pair.
            low: Least value that is possible.
            high: Greatest value that is possible.

        Raises:
            ValueError: If they are not two numbers in order within the bounds.
        """
        values = tuple(getattr(self, name))
        if len(values) != 2 or not low <= values[0] <= values[1] <= high:
            raise ValueError(
                f"dataset.{name}={list(values)} must be two numbers in order, from {low:g} to "
                f"{high:g}"
            )

    def check_numbers(self, **bounds: tuple[float, float]) -> None:
        """Check single numbers against their bounds, by the names of their fields."""
        for name, (low, high) in bounds.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise ValueError(f"dataset.{name}={value} must be from {low:g} to {high:g}")


class Dataset(ABC):
    """Draws the samples of a data set; it keeps nothing from one sample to the next.

    Args:
        cfg: Its numbers.
        senses: Quality of the senses.
        playground: Where the samples are taken.

    Attributes:
        cfg_type: The dataclass of its numbers.
        senses_used: The senses on which it depends.
        fields: The arrays of a sample.
    """

    cfg_type: ClassVar[type[DatasetCfg]]
    senses_used: ClassVar[tuple[str, ...]]
    fields: Mapping[str, Field]

    @abstractmethod
    def __init__(self, cfg: Any, senses: SensesCfg, playground: PlaygroundCfg) -> None: ...

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> Sample:
        """Return a sample that depends only on the generator."""

    def sample(self, seed: int, index: int) -> Sample:
        """Return one sample; it depends only on data set, seed and index.

        Raises:
            ValueError: If it does not fit the fields: a fault of the data set.
        """
        sample = self.draw(sample_generator(self.name, seed, index))
        if sample.keys() != self.fields.keys():
            raise ValueError(f"{self.name}: fields {sorted(sample)}, not {sorted(self.fields)}")
        for name, field in self.fields.items():
            field.check(name, sample[name])
        return sample

    @property
    def name(self) -> str:
        """The name in the registry."""
        return str(self.cfg_type().name)

    @property
    def sample_bytes(self) -> int:
        """Bytes of one sample."""
        return sum(field.n_bytes for field in self.fields.values())


def sample_generator(name: str, seed: int, index: int) -> np.random.Generator:
    """Return the generator of one sample.

    Args:
        name: Name of the data set.
        seed: Seed of the data set, 0 or more.
        index: Index of the sample, 0 or more.
    """
    digest = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8])
    return np.random.default_rng(np.random.SeedSequence([digest, seed, index]))


DATASETS: Registry[type[Dataset]] = Registry("data set")
"""Data sets by name."""


def register_dataset(dataset: type[Dataset]) -> type[Dataset]:
    """Make a data set known under the default of ``cfg_type.name``; a class decorator.

    Raises:
        ValueError: If another one has the name, or its numbers have none.
    """
    default = {field.name: field.default for field in fields(dataset.cfg_type)}["name"]
    if not default:
        raise ValueError(f"{dataset.cfg_type.__name__}.name has no default")
    DATASETS.add(str(default), dataset)
    return dataset
