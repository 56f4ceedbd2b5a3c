"""Experts of the tasks of one child that learns to move: TurnBaby, SitBaby, CrawlBaby, RunBaby."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.locomotion import CrawlLocomotion
from veca_marl.envs.experts.skills.running import Running
from veca_marl.envs.experts.skills.sit_up import SitUp
from veca_marl.envs.experts.skills.turn_over import TurnOver
from veca_marl.envs.tasks.locomotion.crawl_baby import CrawlBaby
from veca_marl.envs.tasks.locomotion.run_baby import RunBaby
from veca_marl.envs.tasks.locomotion.sit_baby import SitBaby
from veca_marl.envs.tasks.locomotion.turn_baby import TurnBaby
from veca_marl.sim.body.humanoid import JointCommand
from veca_marl.sim.geometry import Floats

_FAR_M = 100.0


@register_expert("TurnBaby")
class TurnBabyExpert(Expert[TurnBaby]):
    """Swings one leg and one arm across the body, then stretches; see `TurnOver`.

    Reads the orientation of the trunk from the simulator (privileged).
    """

    def __init__(self, task: TurnBaby, player: Player) -> None:
        super().__init__(task, player)
        self._skill = TurnOver(task.body, task.world.clock.step_s)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._skill.reset()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return self._skill.command()


@register_expert("SitBaby")
class SitBabyExpert(Expert[SitBaby]):
    """Turns to the belly, pushes up on the hands and sits back on the heels; see `SitUp`.

    Reads the pose of the trunk from the simulator (privileged).
    """

    def __init__(self, task: SitBaby, player: Player) -> None:
        super().__init__(task, player)
        self._skill = SitUp(task.body, task.world.clock.step_s)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._skill.reset()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> JointCommand:
        """Return target angles as `JointCommand`."""
        return self._skill.command()


@register_expert("CrawlBaby")
class CrawlBabyExpert(Expert[CrawlBaby]):
    """Crawls straight ahead with an open-loop gait and feedback from its heading.

    Reads position and heading from the simulator (privileged).
    """

    def reset(self) -> None:
        """Take the heading at the start as the direction to crawl in."""
        body = self.task.body
        self._goal = body.position + _FAR_M * body.forward
        self._locomotion = CrawlLocomotion(body, self.task.world.clock.step_s)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> JointCommand:
        """Return target angles as `JointCommand`."""
        return self._locomotion.to(self._goal)


@register_expert("RunBaby")
class RunBabyExpert(Expert[RunBaby]):
    """Steps in the direction of the fall; hips and ankles hold the trunk upright; see `Running`.

    Reads the pose of the trunk from the simulator (privileged).
    """

    def __init__(self, task: RunBaby, player: Player) -> None:
        super().__init__(task, player)
        self._skill = Running(task.body, task.world.clock.step_s)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._skill.reset()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> JointCommand:
        """Return target angles as `JointCommand`."""
        return self._skill.command()
