"""Experts of SoccerOnePlayer and SoccerTwoPlayer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.control.paths.wall_recovery import WallRecovery
from veca_marl.envs.experts.skills.soccer import open_corner, shooting_goal
from veca_marl.envs.tasks.contests.soccer import ATTACKER, Soccer
from veca_marl.sim.geometry import Floats

_TURNING_S = 2.8  # from beside the ball to behind it


@register_expert("SoccerOnePlayer")
class SoccerExpert(Expert[Soccer]):
    """Goes behind the ball and drives it at the goal.

    Reads the positions of the ball and of the players from the simulator (privileged).
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        step_s = self.task.world.clock.step_s
        locomotion = locomotion_of(self.player, step_s)
        self._locomotion = WallRecovery(self.player.body, locomotion, step_s, _TURNING_S)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        clearances, pitch = self._locomotion.clearances, self.task.pitch
        goal = shooting_goal(self.player.body, clearances, pitch, self.aim())
        return self._locomotion.to(goal)

    def aim(self) -> Floats:
        """Return the point to drive the ball to, ``(2,)`` or ``(3,)`` metres."""
        return self.task.goal


@register_expert("SoccerTwoPlayer")
class SoccerTwoPlayerExpert(SoccerExpert):
    """As attacker shoots past the defender; as defender drives the ball away from the goal.

    Reads the positions of the ball and of the players from the simulator (privileged).
    """

    def aim(self) -> Floats:
        """See `SoccerExpert.aim`."""
        if self.player.team == ATTACKER:
            keeper = self.task.players[1].body.position
            return open_corner(self.task.pitch, keeper)
        return 2.0 * self.task.ball.position - self.task.goal
