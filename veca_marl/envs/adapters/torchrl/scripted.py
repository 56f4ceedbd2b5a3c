"""The scripted experts as policies: competence checks, demonstrations, opponents."""

from __future__ import annotations

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import nn

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import find_expert


class ExpertPolicy(nn.Module):
    """Plays all teams of an environment by the experts of its task.

    Args:
        env: The environment it plays in. Experts may read privileged state of these worlds.

    Raises:
        ValueError: If the task has no expert.
    """

    def __init__(self, env: VecaEnv) -> None:
        super().__init__()
        find_expert(env.cfg.task.name)
        self._env = env

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write `(team, "action")` for every team and return the same TensorDict."""
        for team in self._env.group_map:
            seen = tensordict[team, "observation"]
            rows = [
                [
                    player.body.encode(
                        game.expert_of(player).act(
                            {name: array.numpy() for name, array in seen[world, index].items()}
                        )
                    )
                    for index, player in enumerate(game.team(team))
                ]
                for world, game in enumerate(self._env.games)
            ]
            tensordict[team, "action"] = torch.from_numpy(np.array(rows))
        return tensordict
