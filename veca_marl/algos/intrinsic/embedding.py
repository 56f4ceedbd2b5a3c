"""A small network from the normalised vectors of several senses to one vector."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from veca_marl.algos.networks.encoders import VectorEncoder
from veca_marl.algos.networks.initialisation import orthogonal
from veca_marl.algos.specs import ArrayLayout


class Embedding(nn.Module):
    """Vectors ``(n, D)`` of several senses to ``(n, features)``.

    Each sense has an encoder with outputs of about the same scale, whatever its length is.

    Args:
        widths: Sense to the length of its vector; D is their sum.
        features: Length of the output.
    """

    def __init__(self, widths: dict[str, int], features: int) -> None:
        super().__init__()
        self._widths = list(widths.values())
        self.encoders = nn.ModuleList(
            VectorEncoder(_normalised(width), features) for width in widths.values()
        )
        self.join = orthogonal(nn.Linear(features * len(widths), features))

    def forward(self, vectors: Tensor) -> Tensor:
        """Embed `vectors`."""
        parts = vectors.split(self._widths, dim=-1)
        encoded = [encoder(part) for encoder, part in zip(self.encoders, parts, strict=True)]
        embedded: Tensor = self.join(torch.cat(encoded, dim=-1))
        return embedded


def _normalised(width: int) -> ArrayLayout:
    return ArrayLayout((width,), "float32", -math.inf, math.inf)
