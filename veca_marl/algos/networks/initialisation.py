"""How layers are initialised."""

from __future__ import annotations

import math

from torch import nn


def orthogonal(layer: nn.Linear | nn.Conv2d, gain: float = math.sqrt(2.0)) -> nn.Module:
    """Initialise `layer` with an orthogonal matrix and zero biases, and return it.

    Source: Huang et al. 2022, "The 37 implementation details of PPO", detail 2.
    """
    nn.init.orthogonal_(layer.weight, gain)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer
