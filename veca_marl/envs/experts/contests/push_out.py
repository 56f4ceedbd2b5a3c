"""Expert of PushOut1v1 and PushOut2v2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.control.paths.steering import bearing_rad
from veca_marl.envs.experts.push_out import pushing_goal
from veca_marl.envs.tasks.contests.opponents import nearest
from veca_marl.envs.tasks.contests.push_out import PushOut


@register_expert("PushOut1v1")
@register_expert("PushOut2v2")
class PushOutExpert(Expert[PushOut]):
    """Goes round the nearest opponent and pushes it outwards.

    A crawling body moves backwards where a walker turns round, since turning takes space. Reads
    the positions and headings of all players, and middle and radius of the ring from the simulator
    (privileged); on hands and knees also its own joint angles and the orientations of chest and
    pelvis, with which it gets up after a fall.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._locomotion = locomotion_of(self.player, self.task.world.clock.step_s)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Any:
        """Return a command for the player's kind of body, see `Expert.act`."""
        task, body, clearances = self.task, self.player.body, self._locomotion.clearances
        other = nearest(body, task.opponents_playing(self.player))
        goal = pushing_goal(body, clearances, other, task.ring.middle, task.ring.radius_m)
        if abs(bearing_rad(body, goal)) > clearances.back_rad:
            return self._locomotion.back()
        return self._locomotion.to(goal)
