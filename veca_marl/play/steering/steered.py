"""The policy in which the keyboard plays the first actor."""

from __future__ import annotations

from typing import Any

from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import CommandPolicy
from veca_marl.envs.core.expert import find_expert
from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.core.task import Player
from veca_marl.play.steering.keyboard import Keyboard, steerable


class SteeredPolicy(CommandPolicy):
    """Plays the first actor by the keyboard and the others by the expert of the task.

    Args:
        env: The environment.
        keyboard: The keys.

    Raises:
        ValueError: If the first actor has no walking body, or there are others and no expert.
    """

    def __init__(self, env: VecaEnv, keyboard: Keyboard) -> None:
        super().__init__(env)
        self._keyboard = keyboard
        steerable(env.games[0].actors[0].body)
        if len(env.games[0].actors) > 1:
            find_expert(env.cfg.task.name)

    def command(self, game: Game, player: Player, observation: Observation) -> Any:
        """Return the command of the keyboard, or that of the player's expert."""
        if player is game.actors[0]:
            # a game makes new bodies when a simulation breaks down
            return self._keyboard.command(steerable(player.body))
        return game.expert_of(player).act(observation)
