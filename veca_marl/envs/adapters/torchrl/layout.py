"""Nested numpy arrays laid out as a spec says: filled by the games, handed to TorchRL uncopied."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Composite

Arrays = dict[str, Any]  # name -> array, or name -> Arrays


class Layout:
    """The shape of one step's data, read from a spec once and not at every step.

    Args:
        spec: What a tensordict of this layout holds.
    """

    def __init__(self, spec: Composite) -> None:
        self._batch = spec.shape
        self._inner: dict[str, Layout] = {}
        self._leaves: dict[str, tuple[tuple[int, ...], np.dtype[Any]]] = {}
        for name, entry in spec.items():
            if isinstance(entry, Composite):
                self._inner[name] = Layout(entry)
            else:
                self._leaves[name] = (
                    tuple(entry.shape),
                    torch.empty(0, dtype=entry.dtype).numpy().dtype,
                )

    def new(self) -> Arrays:
        """Return new arrays of zeros: whoever stores a step must not see it change."""
        arrays: Arrays = {name: np.zeros(*leaf) for name, leaf in self._leaves.items()}
        for name, layout in self._inner.items():
            arrays[name] = layout.new()
        return arrays

    def copy_rows(self, source: TensorDictBase, arrays: Arrays, rows: list[int]) -> None:
        """Copy rows of what `source` holds of this layout; what it does not hold stays as it is.

        Args:
            source: Where to copy from.
            arrays: What `new` returned.
            rows: Indices along the first axis.
        """
        for name in self._leaves:
            value = source.get(name, None)
            if value is not None:
                arrays[name][rows] = value[rows].numpy(force=True)
        for name, layout in self._inner.items():
            inner = source.get(name, None)
            if inner is not None:
                layout.copy_rows(inner, arrays[name], rows)

    def tensordict(self, arrays: Arrays) -> TensorDict:
        """Return tensors on the memory of what `new` returned."""
        tensors: Arrays = {name: torch.from_numpy(arrays[name]) for name in self._leaves}
        for name, layout in self._inner.items():
            tensors[name] = layout.tensordict(arrays[name])
        # the shapes come from the spec: checking each tensor against the batch size again, as the
        # constructor does, costs a third of all that VecaEnv adds to the games
        return TensorDict._new_unsafe(tensors, self._batch)
