"""Layers: initialisation, one module for each agent, gradients of parts that learn separately."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import torch
from torch import Tensor, nn
from torchrl.modules.functional import symlog


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
        values: Tensor = self.head(torch.cat([features, team_mean(features, mask)], dim=-1))
        return values


class StateValue(nn.Module):
    """Values from each agent's features beside the global state.

    Args:
        head: Maps ``(..., agents, F + S)`` to ``(..., agents, 1)``.
    """

    def __init__(self, head: nn.Module) -> None:
        super().__init__()
        self.head = head

    def forward(self, features: Tensor, state: Tensor) -> Tensor:
        """Return values ``(..., agents, 1)``.

        Args:
            features: ``(..., agents, F)``.
            state: ``(..., S)``; symlog is applied, as its numbers have many magnitudes.
        """
        each = symlog(state).unsqueeze(-2).expand(*features.shape[:-1], -1)
        values: Tensor = self.head(torch.cat([features, each], dim=-1))
        return values


def team_mean(features: Tensor, mask: Tensor | None) -> Tensor:
    """Return the mean over the agents that are left, ``(..., agents, F)`` with equal rows.

    Args:
        features: ``(..., agents, F)``.
        mask: ``(..., agents)``, False for eliminated agents; None where no agent can be
            eliminated.
    """
    if mask is None:
        return features.mean(dim=-2, keepdim=True).expand_as(features)
    present = mask.unsqueeze(-1)
    total = torch.where(present, features, torch.zeros_like(features)).sum(-2, keepdim=True)
    return (total / present.sum(-2, keepdim=True).clamp_min(1)).expand_as(features)


def orthogonal(layer: nn.Linear | nn.Conv2d, gain: float = math.sqrt(2.0)) -> nn.Module:
    """Initialise `layer` with an orthogonal matrix and zero biases, and return it.

    Source: Huang et al. 2022, "The 37 implementation details of PPO", detail 2.
    """
    nn.init.orthogonal_(layer.weight, gain)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer


CRITIC_GAIN = 0.01
"""Gain of the last layer of a critic.

The first values are close to 0. Those of a random layer with a gain of 1 (Huang et al. 2022) are
far larger than the rewards of a step and spoil the first advantages, and a moving average of
critics takes long to lose them.
"""


def value_layer(width: int) -> nn.Module:
    """Return the last layer of a critic, from `width` features to one value."""
    return orthogonal(nn.Linear(width, 1), CRITIC_GAIN)


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


def independent_parameters(modules: Iterable[nn.Module]) -> list[list[nn.Parameter]]:
    """Return the parameters of some modules in groups that learn independently.

    Parameters that all agents share are one group; those that an agent has for itself
    (`PerAgent`) are a group for each agent. Parameters without gradient are left out.
    """
    of_agents: dict[int, list[nn.Parameter]] = {}
    everything: list[nn.Parameter] = []
    for module in modules:
        everything += module.parameters()
        for part in module.modules():
            if isinstance(part, PerAgent):
                for index, agent in enumerate(part.agents):
                    of_agents.setdefault(index, []).extend(agent.parameters())
    own = {id(parameter) for group in of_agents.values() for parameter in group}
    shared = [parameter for parameter in everything if id(parameter) not in own]
    groups = [[p for p in group if p.requires_grad] for group in (shared, *of_agents.values())]
    return [group for group in groups if group]


def clip_norms(groups: Iterable[list[nn.Parameter]], most: float) -> Tensor:
    """Scale the gradient of each group down to a norm, and return the largest norm before it.

    A common norm would let the gradient of one agent determine how much another one learns.

    Args:
        groups: Parameters, see `independent_parameters`.
        most: Largest norm of the gradient of a group.

    Returns:
        A scalar; not finite if a gradient is not.
    """
    return torch.stack([nn.utils.clip_grad_norm_(group, most) for group in groups]).amax()
