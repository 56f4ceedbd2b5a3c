"""Encoder and critics of a team, and the moving average of them that gives targets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy

import torch
from tensordict.nn import TensorDictModuleBase
from torch import nn

from veca_marl.algos.networks.action_values import ActionValues


class Critic(nn.Module):
    """The modules from observations to action values.

    TorchRL's `LossModule` and `SoftUpdate` swap the parameters of one module by TensorDicts
    instead of copying it: a quarter of the processor time of an update of the default network.

    Args:
        encoder: Writes the features.
        values: Reads them.
    """

    encoder: TensorDictModuleBase
    values: ActionValues

    def __init__(self, encoder: TensorDictModuleBase, values: ActionValues) -> None:
        super().__init__()
        self.encoder, self.values = encoder, values

    def copy(self) -> Critic:
        """Return an equal one with parameters of its own, which are never learnt."""
        return deepcopy(self).requires_grad_(False)

    @torch.no_grad()
    def approach(self, other: Critic, share: float) -> None:
        """Move all parameters towards those of `other`, and copy its buffers.

        Args:
            other: A critic with the same modules.
            share: Share of the difference, in (0, 1]; 1 copies.
        """
        torch._foreach_lerp_([*self.parameters()], [*other.parameters()], share)
        for own, new in zip(self.buffers(), other.buffers(), strict=True):
            own.copy_(new)


@contextmanager
def constant(module: nn.Module) -> Iterator[None]:
    """Let gradients flow through `module` but not into it, and its statistics stay as they are."""
    learnt = [parameter for parameter in module.parameters() if parameter.requires_grad]
    for parameter in learnt:
        parameter.requires_grad_(False)
    module.eval()  # batch normalisation uses its running statistics
    try:
        yield
    finally:
        module.train()
        for parameter in learnt:
            parameter.requires_grad_(True)
