"""Encoder of any sense that is not an image: a fixed scale, then two layers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torchrl.modules.functional import symlog

from veca_marl.algos.networks.initialisation import orthogonal
from veca_marl.algos.specs import ArrayLayout


class VectorEncoder(nn.Module):
    """``float (N, ...)`` to ``float (N, features)``: a fixed scale (see `scale_of`), then an MLP.

    Args:
        layout: Layout of one observation.
        features: Length of the output.
        compressed: See `scale_of`.

    Attributes:
        features: Length of the output.
        shape: Shape of one observation.
        scale: See `scale_of`.
    """

    def __init__(self, layout: ArrayLayout, features: int = 64, compressed: bool = False) -> None:
        super().__init__()
        self.shape, self.scale = tuple(layout.shape), scale_of(layout, compressed)
        self.layers = nn.Sequential(
            orthogonal(nn.Linear(math.prod(layout.shape), features)),
            nn.ReLU(),
            orthogonal(nn.Linear(features, features)),
            nn.ReLU(),
        )
        self.features = features

    def forward(self, vector: Tensor) -> Tensor:
        """Encode `vector`."""
        features: Tensor = self.layers(self.scale(vector.flatten(1).to(torch.float32)))
        return features


Scale = Callable[[Tensor], Tensor]


def scale_of(layout: ArrayLayout, compressed: bool) -> Scale:
    """Return the function that scales an array to numbers of about 1.

    Bounds are mapped to -1 and 1; an array without bounds is unchanged, or compressed (symlog,
    Hafner et al. 2023, "Mastering diverse domains through world models"). Nothing is normalised by
    running statistics, which would remove absolute level (loudness is a cue for distance).

    Args:
        layout: Layout of the array.
        compressed: Whether to compress an array without bounds.
    """
    if math.isfinite(layout.low) and math.isfinite(layout.high):
        return Affine((layout.low + layout.high) / 2, 2.0 / (layout.high - layout.low))
    return symlog if compressed else unchanged


@dataclass(frozen=True)
class Affine:
    """Maps `centre` to 0, and multiplies distances from it by `factor`."""

    centre: float
    factor: float

    def __call__(self, vector: Tensor) -> Tensor:
        """Scale `vector`."""
        return (vector - self.centre) * self.factor


def unchanged(vector: Tensor) -> Tensor:
    """Return `vector`."""
    return vector
