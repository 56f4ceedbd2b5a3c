"""The scripted experts as policies: competence checks, demonstrations, opponents."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import nn

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.expert import check_expert, find_expert
from veca_marl.envs.core.game import Game, Observation, from_parts
from veca_marl.envs.core.task import Player


class CommandPolicy(nn.Module, ABC):
    """Plays all teams of an environment by commands that the bodies encode as actions.

    Args:
        env: The environment it plays in.
    """

    def __init__(self, env: VecaEnv) -> None:
        super().__init__()
        self._env = env

    @abstractmethod
    def command(self, game: Game, player: Player, observation: Observation) -> Any:
        """Return the command of a player for the next step, see `Body.encode`."""

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write `(team, "action")`, or its parts, for every team; return the same TensorDict."""
        for team in self._env.group_map:
            seen = tensordict[team, "observation"]
            rows = [
                [
                    player.body.encode(
                        self.command(
                            game,
                            player,
                            {
                                name: array.numpy(force=True)
                                for name, array in seen[world, index].items()
                            },
                        )
                    )
                    for index, player in enumerate(game.team(team))
                ]
                for world, game in enumerate(self._env.games)
            ]
            tensordict[team, "action"] = _stacked(rows, tensordict.batch_size)
        return tensordict


class ExpertPolicy(CommandPolicy):
    """Plays all teams of an environment by the experts of its task.

    Args:
        env: The environment it plays in. Experts may read privileged state of these worlds.

    Raises:
        ValueError: If the task has no expert, it needs a sense that a player has not, or it cannot
            play at this control rate.
    """

    def __init__(self, env: VecaEnv) -> None:
        super().__init__(env)
        expert = find_expert(env.cfg.task.name)
        for player in env.games[0].actors:
            check_expert(expert, player, env.games[0].world.clock)

    def command(self, game: Game, player: Player, observation: Observation) -> Any:
        """Return the command of the player's expert."""
        return game.expert_of(player).act(observation)


def _stacked(
    actions: list[list[dict[str, NDArray[Any]]]], worlds: torch.Size
) -> torch.Tensor | TensorDict:
    """Return the actions of a team, by world and player, as tensors ``(W, n, ...)``."""
    players = len(actions[0])
    tensors = {
        part: torch.from_numpy(np.array([[action[part] for action in row] for row in actions]))
        for part in actions[0][0]
    }
    leaf = from_parts(tensors)
    return TensorDict(leaf, (*worlds, players)) if isinstance(leaf, dict) else leaf
