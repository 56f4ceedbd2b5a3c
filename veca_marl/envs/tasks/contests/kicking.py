"""Automatic kicks of walkers that run into the ball."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import horizontal_distance
from veca_marl.sim.physics import Prop

_LEAST_SPEED_MPS = 0.1  # a standing walker does not kick: the ball rebounds


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
        self._left_s = {player.name: 0.0 for player in self._players}

    def after_step(self, step_s: float) -> None:
        """Count a step of a duration and let one player kick if it can."""
        ball = self._ball.position
        nearest_first = sorted(
            self._players, key=lambda p: horizontal_distance(p.body.position, ball)
        )
        self._left_s = {name: left_s - step_s for name, left_s in self._left_s.items()}
        for player in nearest_first:
            if self._left_s[player.name] <= 0.0 and self._kicks(player):
                self._left_s[player.name] = self._rest_s
                return

    def _kicks(self, player: Player) -> bool:
        """Let a player kick if it can; return whether it has."""
        body = player.body
        walks = float(body.velocity @ body.forward) > _LEAST_SPEED_MPS
        return walks and isinstance(body, Walker) and body.kick(self._ball)
