"""Critics that predict normalised values, and the running statistics behind them."""

from __future__ import annotations

from enum import Enum

import torch
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torch import Tensor, nn
from torchrl.modules import PopArtValueNorm


class ValueNormalisation(Enum):
    """What the last layer of the critic predicts, and in which unit the value loss is measured.

    Attributes:
        none: The returns themselves.
        running: Returns normalised by the running mean and standard deviation of the value targets
            (Yu et al. 2022, "The surprising effectiveness of PPO", section 5.1). When the
            statistics change, the values that the critic predicts change with them.
        popart: As `running`; in addition the last layer is rescaled when the statistics change, so
            that predicted values stay the same (van Hasselt et al. 2016, "Learning values across
            many orders of magnitude").
    """

    none = "none"
    running = "running"
    popart = "popart"


class NormalisedCritic(nn.Module):
    """Running statistics of value targets, and the critic whose outputs they scale.

    TorchRL's `PopArtValueNorm` holds the statistics: debiased exponential averages of the mean and
    the mean square with a decay of 0.99999, the value of Yu et al. In TorchRL's `MAPPOLoss` it
    divides the loss alone: the critic still predicts returns, and no layer is rescaled.

    Args:
        critic: Writes normalised values.
        key: Key of the values.
        preserve: Whether `update` rescales the last layer (PopArt).

    Attributes:
        statistics: The running statistics.
        critic: Writes values in the unit of the returns.

    Raises:
        ValueError: If values are to be preserved and no linear layer of the critic has one output.
    """

    def __init__(self, critic: TensorDictModuleBase, key: tuple[str, ...], preserve: bool) -> None:
        super().__init__()
        self.statistics = PopArtValueNorm(shape=1)
        denormalise = TensorDictModule(_Denormalise(self.statistics), in_keys=[key], out_keys=[key])
        self.critic = TensorDictSequential(critic, denormalise)
        self._last_layers = _value_layers(critic) if preserve else []

    @torch.no_grad()
    def update(self, targets: Tensor) -> None:
        """Add the value targets of a batch to the statistics.

        Args:
            targets: ``(n, 1)``, without those of agents that are eliminated.
        """
        if not targets.numel():
            return
        before = self._location_and_scale()
        first = not self.statistics.debiasing_term.any()
        self.statistics.update(targets)
        if first:  # the last layer has learnt nothing that could be preserved
            return
        mean, scale = self._location_and_scale()
        for layer in self._last_layers:
            layer.weight.mul_(before[1] / scale)
            layer.bias.mul_(before[1]).add_(before[0] - mean).div_(scale)

    def _location_and_scale(self) -> tuple[Tensor, Tensor]:
        origin = torch.zeros_like(self.statistics.running_mean)
        return self.statistics.denormalize(origin), self.statistics.scale()


class _Denormalise(nn.Module):
    """Normalised values to values in the unit of the returns."""

    def __init__(self, statistics: PopArtValueNorm) -> None:
        super().__init__()
        self.statistics = statistics

    def forward(self, normalised: Tensor) -> Tensor:
        values: Tensor = self.statistics.denormalize(normalised)
        return values


def _value_layers(critic: nn.Module) -> list[nn.Linear]:
    """Return the last layer of the critic: one, or one for each agent."""
    layers = [m for m in critic.modules() if isinstance(m, nn.Linear) and m.out_features == 1]
    if not layers or any(layer.bias is None for layer in layers):
        raise ValueError(
            "algo.value_normalisation=popart rescales a linear layer with one output and a bias, "
            "and the critic has none; choices: none, running"
        )
    return layers
