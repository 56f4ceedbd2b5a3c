"""Experts of SoccerOnePlayer and SoccerTwoPlayer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.control.path_following import WallRecovery
from veca_marl.envs.experts.control.paths.steering import bearing_rad
from veca_marl.envs.experts.skills.soccer import attacking_point, clearing_point
from veca_marl.envs.experts.soccer import Shooter
from veca_marl.envs.tasks.contests.soccer import ATTACKER, Soccer
from veca_marl.sim.geometry import Floats

_TURNING_S = 2.8  # from beside the ball to behind it
_CHEST_M = 0.3  # from the pelvis forwards, for bodies on hands and knees
_KEEPER_M = 0.7  # distance of the chest from the other player, likewise
_BEHIND_RAD = 2.5  # a body that turns to a place at a greater bearing does not change the side
_FREE_M = 0.45  # distance of the chest from walls at which they do not stop the body


@register_expert("SoccerOnePlayer")
class SoccerExpert(Expert[Soccer]):
    """Goes behind the ball and drives it into the goal.

    Reads position and velocity of the ball, the positions of the players, its own heading, and
    edges and goal of the pitch from the simulator (privileged); on hands and knees also its own
    joint angles and the orientations of chest and pelvis, with which it gets up after a fall.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        step_s = self.task.world.clock.step_s
        locomotion = locomotion_of(self.player, step_s)
        self._locomotion = WallRecovery(
            self.player.body, locomotion, step_s, _TURNING_S, self._has_space
        )
        self._side = 0.0

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        here = self.player.body.position[:2]
        shooter = Shooter(here, self._locomotion.clearances, self.keeper())
        return self._locomotion.to(self._on_one_side(self.point(shooter)))

    def point(self, shooter: Shooter) -> Floats:
        """Return the point to steer to, ``(2,)`` metres."""
        return attacking_point(shooter, self.task.pitch)

    def keeper(self) -> Floats | None:
        """Return the position of the opponent, ``(2,)`` metres; None if there is none."""
        others = [player for player in self.task.players if player is not self.player]
        return others[0].body.position[:2] if others else None

    def _on_one_side(self, point: Floats) -> Floats:
        """Return a point, or one beside the body while it turns to a point behind it.

        On hands and knees the heading swings by about 20 degrees during a stride. The point behind
        would be on the left and on the right in turn.
        """
        body = self.player.body
        bearing = bearing_rad(body, point)
        if abs(bearing) < _BEHIND_RAD or self._side == 0.0:
            self._side = math.copysign(1.0, bearing)
        if bearing * self._side > 0.0:
            return point
        ahead = body.forward[:2]
        return body.position[:2] + self._side * np.array([-ahead[1], ahead[0]])

    def _has_space(self) -> bool:
        """Return whether walls and the other player are too far away to stop the body."""
        body, pitch, keeper = self.player.body, self.task.pitch, self.keeper()
        chest = body.position[:2] + _CHEST_M * body.forward[:2]
        if keeper is not None and math.dist(chest, keeper) < _KEEPER_M:
            return False
        return bool((chest > pitch.low + _FREE_M).all() and (chest < pitch.high - _FREE_M).all())


@register_expert("SoccerTwoPlayer")
class SoccerTwoPlayerExpert(SoccerExpert):
    """As attacker shoots past the defender; as defender drives the ball away from the goal.

    Reads what `SoccerExpert` reads (privileged): position and velocity of the ball, the positions
    of the players, its own heading, edges and goal of the pitch; on hands and knees also its own
    joint angles and the orientations of chest and pelvis.
    """

    def point(self, shooter: Shooter) -> Floats:
        """See `SoccerExpert.point`."""
        if self.player.team == ATTACKER:
            return super().point(shooter)
        return clearing_point(replace(shooter, keeper=None), self.task.pitch)
