"""Progress of players along the paths through a house to an object."""

from __future__ import annotations

import math
from collections.abc import Sequence

from veca_marl.envs.core.task import Player
from veca_marl.envs.tasks.navigation.floor_plan import FloorPlan
from veca_marl.sim.physics import Prop


class PathProgress:
    """Decrease of the length of each player's path to an object; furniture is ignored.

    Without a path through doors it is 0.

    Args:
        plan: Rooms and doors.
    """

    def __init__(self, plan: FloorPlan) -> None:
        self._plan = plan
        self._lengths_m: dict[str, float] = {}
        self._progress_m: dict[str, float] = {}

    def reset(self, prop: Prop, players: Sequence[Player]) -> None:
        """Begin an episode. Called after prop and players have been placed.

        Args:
            prop: The object.
            players: All players.
        """
        self._prop = prop
        self._progress_m = {}
        self._lengths_m = {player.name: self._length_m(player) for player in players}

    def after_step(self, players: Sequence[Player]) -> None:
        """Compute the progress of a step. Called once per step.

        Args:
            players: The players that still search; the progress of the others is 0.
        """
        before_m = self._lengths_m
        self._lengths_m = {player.name: self._length_m(player) for player in players}
        self._progress_m = {
            name: before_m[name] - now_m if math.isfinite(now_m) else 0.0
            for name, now_m in self._lengths_m.items()
        }

    def of(self, player: Player) -> float:
        """Return by how much the path of a player has become shorter in the last step, m."""
        return self._progress_m.get(player.name, 0.0)

    def _length_m(self, player: Player) -> float:
        return self._plan.path_m(player.body.position, self._prop.position)
