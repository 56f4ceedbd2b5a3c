"""The scripted experts as policies: competence checks, demonstrations, opponents."""

from __future__ import annotations

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import nn

from veca_marl.envs.adapters.torchrl.env import VecaEnv


class ExpertPolicy(nn.Module):
    """Plays all teams of an environment by its task's hand-written rules.

    Args:
        env: The environment it plays in: experts may use privileged state (`Task.expert` says
            which do), so the policy belongs to these very worlds.
    """

    def __init__(self, env: VecaEnv) -> None:
        super().__init__()
        self._env = env

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write `(team, "action")` for every team and return the same TensorDict."""
        for team in self._env.group_map:
            seen = tensordict[team, "observation"]
            rows = [
                [
                    player.body.encode(
                        game.task.expert(
                            player,
                            {name: array.numpy() for name, array in seen[world, index].items()},
                        )
                    )
                    for index, player in enumerate(game.team(team))
                ]
                for world, game in enumerate(self._env.games)
            ]
            tensordict[team, "action"] = torch.from_numpy(np.array(rows))
        return tensordict
