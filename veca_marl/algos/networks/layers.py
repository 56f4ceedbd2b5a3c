"""Modules of a whole team: one for each agent, and what a central critic adds to features."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn


class PerAgent(nn.Module):
    """A module of its own for each agent: ``(..., agents, *shape)`` to ``(..., agents, F)``.

    Args:
        make: Makes one; its input keeps an agent dimension, of length one.
        agents: Number of agents.
        ranks: Number of dimensions of each input's `shape`.
    """

    def __init__(self, make: Callable[[], nn.Module], agents: int, ranks: Sequence[int]) -> None:
        super().__init__()
        self.agents = nn.ModuleList(make() for _ in range(agents))
        self._dims = [-rank - 1 for rank in ranks]

    def forward(self, *arrays: Tensor) -> Tensor:
        """Apply each agent's module to its entries."""
        parts = [
            module(*(a.narrow(d, i, 1) for a, d in zip(arrays, self._dims, strict=True)))
            for i, module in enumerate(self.agents)
        ]
        return torch.cat(parts, dim=-2)


class CentralValue(nn.Module):
    """Values from each agent's features beside the mean of its team's.

    Agents that are eliminated do not enter the mean.

    Args:
        head: Maps ``(..., agents, 2 F)`` to ``(..., agents, 1)``.
    """

    def __init__(self, head: nn.Module) -> None:
        super().__init__()
        self.head = head

    def forward(self, features: Tensor, mask: Tensor | None = None) -> Tensor:
        """Return values ``(..., agents, 1)``.

        Args:
            features: ``(..., agents, F)``.
            mask: ``(..., agents)``, False for agents that are eliminated; None counts all.
        """
        values: Tensor = self.head(torch.cat([features, _team_mean(features, mask)], dim=-1))
        return values


def _team_mean(features: Tensor, mask: Tensor | None) -> Tensor:
    if mask is None:
        return features.mean(dim=-2, keepdim=True).expand_as(features)
    present = mask.unsqueeze(-1)
    total = torch.where(present, features, torch.zeros_like(features)).sum(-2, keepdim=True)
    return (total / present.sum(-2, keepdim=True).clamp_min(1)).expand_as(features)
