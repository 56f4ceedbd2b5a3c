"""What acts for all teams together, and the uniform actions with which a team may start."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictSequential
from torch import Tensor, nn
from torchrl.envs import ExplorationType
from torchrl.envs.utils import exploration_type

from veca_marl.algos.acting import Arrays, DirectPolicy
from veca_marl.algos.networks.encoders import for_acting
from veca_marl.algos.specs import ActionLayout, TeamSpec, action_key


class UniformWarmUp(TensorDictModuleBase):
    """Replaces a team's action by a uniformly random one while `active`.

    TorchRL's collectors count ``init_random_frames`` from their own start; here the switch is a
    buffer, which checkpoints keep and which reaches worker processes with the parameters.

    Args:
        team: Name of the team.
        spec: Its arrays.

    Attributes:
        active: Whether actions are replaced (where the exploration type asks for samples).
    """

    active: Tensor

    def __init__(self, team: str, spec: TeamSpec) -> None:
        super().__init__()
        self._actions = {action_key(team, p): layout for p, layout in spec.actions.items()}
        self.in_keys = self.out_keys = list(self._actions)
        self.register_buffer("active", torch.ones((), dtype=torch.bool))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Replace the action in place and return `tensordict`."""
        self.write(tensordict)
        return tensordict

    def write(self, arrays: Arrays) -> None:
        """See `acting.WritesArrays`."""
        if bool(self.active) and exploration_type() in (ExplorationType.RANDOM, None):
            for key, layout in self._actions.items():
                arrays[key] = _uniform(layout, arrays[key])


def _uniform(layout: ActionLayout, like: Tensor) -> Tensor:
    if layout.discrete:
        return torch.randint_like(like, layout.size)
    return torch.rand_like(like) * 2.0 - 1.0


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
