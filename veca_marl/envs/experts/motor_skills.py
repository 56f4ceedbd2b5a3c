"""Experts of the tasks of one child that learns to move: TurnBaby, SitBaby, CrawlBaby, RunBaby."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Player, Task, require_humanoid
from veca_marl.envs.experts.control.locomotion import CrawlLocomotion
from veca_marl.envs.experts.control.posture_transitions import TurnOver
from veca_marl.envs.experts.control.sit_up import SitUp
from veca_marl.envs.experts.control.stepping import Stepping
from veca_marl.envs.tasks.locomotion.crawl_baby import CrawlBaby
from veca_marl.sim.body.humanoid import JointCommand
from veca_marl.sim.geometry import Floats

_FAR_M = 100.0


class SkillExpert(Expert[Task]):
    """Executes one skill of a joint-level body from the start of an episode to its end.

    Attributes:
        skill_type: The skill.
    """

    reads = ()

    skill_type: ClassVar[type[TurnOver | SitUp | Stepping]]

    def __init__(self, task: Task, player: Player) -> None:
        super().__init__(task, player)
        self._skill = self.skill_type(require_humanoid(player), task.world.clock.step_s)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._skill.reset()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats | JointCommand:
        """Return target angles ``(82,)`` in rad, or a `JointCommand`."""
        return self._skill.command()

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._skill.follow_body()


@register_expert("TurnBaby")
class TurnBabyExpert(SkillExpert):
    """Swings one leg and one arm across the body, then stretches; see `TurnOver`.

    Reads the orientations of chest and pelvis, and the joint angles at the start of each swing from
    the simulator (privileged).
    """

    skill_type = TurnOver


@register_expert("SitBaby")
class SitBabyExpert(SkillExpert):
    """Turns to the belly, pushes up on the hands, sits back on the heels and rises; see `SitUp`.

    Reads the poses of its bones, and the angles, velocities and strengths of its joints from the
    simulator (privileged); with position control also the forces on its joints.
    """

    skill_type = SitUp


@register_expert("CrawlBaby")
class CrawlBabyExpert(Expert[CrawlBaby]):
    """Crawls straight ahead with an open-loop gait and feedback from its heading.

    After a fall on its back or a side it gets back onto hands and knees; see `GetUp`. Reads
    position, heading, joint angles and the orientations of chest and pelvis from the simulator
    (privileged).
    """

    reads = ()

    def reset(self) -> None:
        """Take the heading at the start as the direction to crawl in."""
        body = self.task.body
        self._goal = body.position + _FAR_M * body.forward
        self._locomotion = CrawlLocomotion(body, self.task.world.clock.step_s)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> JointCommand:
        """Return target angles as `JointCommand`."""
        return self._locomotion.to(self._goal)

    def follow_body(self) -> None:
        """See `Expert.follow_body`."""
        self._locomotion.follow_body()


@register_expert("RunBaby")
class RunBabyExpert(SkillExpert):
    """Balances, and makes two or three steps forwards before it falls; see `Stepping`.

    Reads the pose and the velocity of the trunk and the positions of the feet from the simulator
    (privileged).
    """

    skill_type = Stepping
