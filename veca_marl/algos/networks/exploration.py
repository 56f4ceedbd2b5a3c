"""Exploration that TorchRL's modules do not offer in a form that survives a restart."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import ExplorationType
from torchrl.envs.utils import exploration_type

from veca_marl.algos.acting.keys import Arrays
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
        """See `acting.modules.WritesArrays`."""
        if bool(self.active) and exploration_type() in (ExplorationType.RANDOM, None):
            for key, layout in self._actions.items():
                arrays[key] = _uniform(layout, arrays[key])


def _uniform(layout: ActionLayout, like: Tensor) -> Tensor:
    if layout.discrete:
        return torch.randint_like(like, layout.size)
    return torch.rand_like(like) * 2.0 - 1.0
