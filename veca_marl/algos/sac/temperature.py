"""The weight of the entropy of each part of an action."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor, nn

from veca_marl.algos.sac.config import Adaptation, TemperatureCfg
from veca_marl.algos.sac.masks import masked_mean
from veca_marl.algos.specs import ActionLayout


class Temperatures(nn.Module):
    """A temperature alpha for each part of the action, fixed or learnt.

    Args:
        actions: Part to its layout.
        cfg: Initial value, adaptation and target entropies.

    Attributes:
        targets: Part to its target entropy in nats.
    """

    def __init__(self, actions: Mapping[str, ActionLayout], cfg: TemperatureCfg) -> None:
        super().__init__()
        self.targets = {part: _target(layout, cfg) for part, layout in actions.items()}
        learnt = cfg.adaptation is Adaptation.automatic
        self._least = math.log(cfg.minimum) if cfg.minimum > 0.0 else -math.inf
        self._logs = nn.ParameterDict(
            {
                part: nn.Parameter(torch.tensor(math.log(cfg.initial)), requires_grad=learnt)
                for part in actions
            }
        )

    def alphas(self) -> dict[str, Tensor]:
        """Return the temperature of each part, without gradient."""
        return {part: log.detach().exp() for part, log in self._logs.items()}

    @torch.no_grad()
    def project(self) -> None:
        """Raise temperatures below the minimum to it; to be called after each gradient step."""
        for log in self._logs.values():
            log.clamp_(min=self._least)

    def bonus(self, entropies: Mapping[str, Tensor]) -> Tensor:
        """Return the sum of entropies, weighted by their temperatures."""
        alphas = self.alphas()
        return sum((alphas[part] * entropy for part, entropy in entropies.items()), torch.zeros(()))

    def loss(self, entropies: Mapping[str, Tensor], counted: Tensor) -> Tensor:
        """Return the loss that raises a temperature where the entropy is below its target.

        ``log(alpha) * (entropy - target)`` instead of ``alpha * (entropy - target)``: the form of
        the authors' code and of TorchRL's `SACLoss`.

        Args:
            entropies: Part to its entropy ``(..., agents)``.
            counted: ``(..., agents)``, True for the entries that count.
        """
        losses = [
            self._logs[part] * masked_mean(entropy.detach() - self.targets[part], counted)
            for part, entropy in entropies.items()
        ]
        return torch.stack(losses).sum()


def _target(layout: ActionLayout, cfg: TemperatureCfg) -> float:
    if layout.discrete:
        return cfg.entropy_of_choices * math.log(layout.size)
    return cfg.entropy_per_dimension * layout.size
