"""SOFA files (AES69) and their fields, each checked before anything is allocated. Needs h5py."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from veca_marl.sim.geometry import Floats

MOST_VALUES = 1 << 26
"""Largest number of values of one field, 512 MiB of float64, four times the largest known set."""

# deflate, the compression of netCDF, reaches at most 1032 to 1
_STRONGEST_COMPRESSION = 1100
# small fields of which nothing is stored hold the default value of their variable
_NEVER_WRITTEN_BYTES = 1 << 16
_LONGEST_ATTRIBUTE = 1 << 16


class SofaError(ValueError):
    """The file does not contain usable head-related impulse responses; the message says why."""


@dataclass(frozen=True)
class Field:
    """One numeric field.

    Attributes:
        values: Its values.
        kind: Its attribute Type (``cartesian`` or ``spherical``), empty if absent.
        units: Its attribute Units in lower case, empty if absent.
    """

    values: Floats
    kind: str
    units: str


class SofaFile:
    """An open SOFA file."""

    def __init__(self, file: Any, name: str) -> None:
        self._file = file
        self._name = name

    def attribute(self, key: str) -> str:
        """Return a global attribute, empty if it is absent."""
        return self._attribute(self._file, key)

    def __contains__(self, key: str) -> bool:
        """Whether the file has an object of this name."""
        return self._file.get(key, getlink=True, default=None) is not None

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the declared shape of a field.

        Raises:
            SofaError: If the field is absent, not numeric, stored in another file, or larger than
                `MOST_VALUES` or than its stored bytes can hold.
        """
        return tuple(self._dataset(key).shape)

    def read(self, key: str) -> Field:
        """Return a field as float64; see `shape` for what is refused before."""
        dataset = self._dataset(key)
        values = np.array(dataset[()], dtype=np.float64)
        kind = self._attribute(dataset, "Type").lower()
        return Field(values, kind, self._attribute(dataset, "Units").lower())

    def _dataset(self, key: str) -> Any:
        import h5py

        link = self._file.get(key, getlink=True, default=None)
        if link is None:
            raise SofaError(f"{self._name}: lacks {key}")
        if not isinstance(link, h5py.HardLink):
            raise SofaError(f"{self._name}: {key} is a link to another place, which is refused")
        dataset = self._file[key]
        if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu":
            raise SofaError(f"{self._name}: {key} is not an array of numbers")
        if dataset.external or dataset.is_virtual:
            raise SofaError(f"{self._name}: {key} is stored in another file, which is refused")
        self._check_size(key, dataset)
        return dataset

    def _check_size(self, key: str, dataset: Any) -> None:
        # Python integers: the product of declared sizes may exceed 64 bits
        count = math.prod(int(size) for size in dataset.shape)
        if count > MOST_VALUES:
            raise SofaError(
                f"{self._name}: {key} declares {count} values, at most {MOST_VALUES} are read"
            )
        if math.prod(dataset.chunks or (1,)) > MOST_VALUES:
            raise SofaError(f"{self._name}: {key} is stored in chunks of shape {dataset.chunks}")
        stored = dataset.id.get_storage_size()
        if count * dataset.dtype.itemsize > _STRONGEST_COMPRESSION * stored + _NEVER_WRITTEN_BYTES:
            raise SofaError(
                f"{self._name}: {key} declares {count} values but only {stored} bytes are stored"
            )

    def _attribute(self, owner: Any, key: str) -> str:
        if key not in owner.attrs:
            return ""
        stored = owner.attrs.get_id(key)
        if math.prod(stored.shape or (1,)) != 1 or stored.dtype.itemsize > _LONGEST_ATTRIBUTE:
            raise SofaError(f"{self._name}: the attribute {key} is not a short text")
        value = np.ravel(owner.attrs[key])[0]
        return (value.decode(errors="replace") if isinstance(value, bytes) else str(value)).strip()


def check_can_read_sofa(path: str) -> None:
    """Raise `ValueError` if a SOFA file is wanted and h5py, which reads them, is missing."""
    if find_spec("h5py") is None:
        raise ValueError(
            f"senses.audio.sofa_path={path}: SOFA files need h5py: pip install 'veca_marl[sofa]'"
        )


@contextmanager
def open_sofa(path: str | Path) -> Iterator[SofaFile]:
    """Open a SOFA file.

    Raises:
        ImportError: If h5py is missing.
        SofaError: If it does not exist or cannot be read, also while its fields are read.
    """
    try:
        import h5py
    except ImportError:
        raise ImportError("SOFA files need h5py: pip install 'veca_marl[sofa]'") from None
    name = Path(path).name
    if not os.path.isfile(path):  # False also for a name that is too long
        raise SofaError(f"{path}: no such file")
    try:
        with h5py.File(path, "r") as file:
            yield SofaFile(file, name)
    except SofaError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise SofaError(f"{name}: cannot be read as SOFA ({error})") from error
