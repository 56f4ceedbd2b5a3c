"""How layers are initialised."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from torch import nn


def orthogonal(layer: nn.Linear | nn.Conv2d, gain: float = math.sqrt(2.0)) -> nn.Module:
    """Initialise `layer` with an orthogonal matrix and zero biases, and return it.

    Source: Huang et al. 2022, "The 37 implementation details of PPO", detail 2.
    """
    nn.init.orthogonal_(layer.weight, gain)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer


def perceptron(
    inputs: int,
    hidden: Sequence[int],
    outputs: int,
    gain: float = 1.0,
    norm: Callable[[int], nn.Module] | None = None,
) -> nn.Module:
    """Return orthogonally initialised layers with ReLU; one linear layer if `hidden` is empty.

    Args:
        inputs: Width of the input.
        hidden: Widths of the hidden layers.
        outputs: Width of the output.
        gain: Gain of the last layer.
        norm: Makes the normalisation before each activation from its width.
    """
    layers: list[nn.Module] = []
    for width in hidden:
        layers.append(orthogonal(nn.Linear(inputs, width)))
        layers += [nn.ReLU()] if norm is None else [norm(width), nn.ReLU()]
        inputs = width
    last = orthogonal(nn.Linear(inputs, outputs), gain)
    return nn.Sequential(*layers, last) if layers else last
