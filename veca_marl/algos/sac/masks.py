"""Means over the entries that count."""

from __future__ import annotations

import torch
from torch import Tensor


def masked_mean(x: Tensor, counted: Tensor) -> Tensor:
    """Return the mean of `x` over the entries that are True in `counted`; 0 if there are none.

    Args:
        x: Any shape.
        counted: Shape that `x` has, or one that is broadcast to it.
    """
    counted = counted.expand_as(x)
    return torch.where(counted, x, torch.zeros_like(x)).sum() / counted.sum().clamp_min(1)
