"""Automatic kicks of walkers that run into the ball."""

from __future__ import annotations

import math
from collections.abc import Sequence

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import horizontal_distance
from veca_marl.sim.physics import Prop

_ROUNDING = 1e-6  # in agent steps
_LEAST_SPEED_MPS = 0.1  # a standing walker does not kick: it stops the ball


class AutomaticKicks:
    """Lets walkers kick a ball that is within reach of a foot while they walk forwards.

    In one step only the nearest player kicks. Joint-level bodies do not kick automatically.

    Args:
        players: All players.
        ball: The ball.
        rest_s: Least time between two kicks of a player.
    """

    def __init__(self, players: Sequence[Player], ball: Prop, rest_s: float) -> None:
        self._players, self._ball, self._rest_s = players, ball, rest_s
        self.reset()

    def reset(self) -> None:
        """Allow all players to kick."""
        self._steps_left = {player.name: 0 for player in self._players}

    def after_step(self, step_s: float) -> None:
        """Count a step of a duration and let one player kick if it can."""
        ball = self._ball.position
        nearest_first = sorted(
            self._players, key=lambda p: horizontal_distance(p.body.position, ball)
        )
        self._steps_left = {name: steps - 1 for name, steps in self._steps_left.items()}
        for player in nearest_first:
            if self._steps_left[player.name] <= 0 and self._kicks(player):
                self._steps_left[player.name] = math.ceil(self._rest_s / step_s - _ROUNDING)
                return

    def _kicks(self, player: Player) -> bool:
        """Let a player kick if it can; return whether it has."""
        body = player.body
        walks = float(body.velocity @ body.forward) > _LEAST_SPEED_MPS
        return walks and isinstance(body, Walker) and body.kick(self._ball)
