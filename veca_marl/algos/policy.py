"""What acts for all teams together."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy

import torch
from tensordict.nn import TensorDictModuleBase, TensorDictSequential
from torch import nn

from veca_marl.algos.acting.direct import DirectPolicy
from veca_marl.algos.networks.exploration import UniformWarmUp
from veca_marl.algos.networks.precision import for_acting


class Policy(nn.Module):
    """What acts for all teams.

    Args:
        actors: Team to the policy that is evaluated.
        explorers: Team to the policy that collects; it shares its modules with the actor.

    Attributes:
        actors: See above.
        play: Writes the actions of all teams, for evaluation.
        collect: Writes the actions of all teams, for collection.
    """

    def __init__(
        self,
        actors: Mapping[str, TensorDictModuleBase],
        explorers: Mapping[str, TensorDictModuleBase],
    ) -> None:
        super().__init__()
        self.actors = nn.ModuleDict(actors)
        self.play: TensorDictModuleBase = TensorDictSequential(*actors.values())
        self.collect: TensorDictModuleBase = TensorDictSequential(*explorers.values())
        self._explorers = dict(explorers)

    def end_warm_up(self, team: str) -> None:
        """Let a team collect with its actor from now on, without uniformly random actions."""
        for module in self._explorers[team].modules():
            if isinstance(module, UniformWarmUp):
                module.active.fill_(False)

    def copy(self) -> Policy:
        """Return an independent copy that acts on the CPU, by `DirectPolicy`."""
        copied = for_acting(deepcopy(self).to("cpu"))
        copied.play, copied.collect = DirectPolicy(copied.play), DirectPolicy(copied.collect)
        return copied

    @torch.no_grad()
    def take_over(self, other: Policy) -> None:
        """Take over parameters and buffers of `other`, a policy of the same structure."""
        for own, new in zip(_tensors(self), _tensors(other), strict=True):
            own.copy_(new)


def _tensors(module: nn.Module) -> list[torch.Tensor]:
    return [*module.parameters(), *module.buffers()]
