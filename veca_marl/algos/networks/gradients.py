"""Gradients of networks: their norm, limited for each part that learns by itself."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from veca_marl.algos.networks.layers import PerAgent


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
