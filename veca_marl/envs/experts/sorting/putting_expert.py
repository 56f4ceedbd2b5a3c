"""Base of the experts of ColorSort, ShapeSort and FillFraction: props are put into containers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, TypeVar

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert
from veca_marl.envs.core.task import Task
from veca_marl.envs.experts.control.handling import Handling
from veca_marl.sim.body.walker import WalkCommand, Walker
from veca_marl.sim.geometry import horizontal_distance
from veca_marl.sim.physics import Prop

TaskT = TypeVar("TaskT", bound=Task)


class PuttingExpert(Expert[TaskT]):
    """Takes the nearest prop to the container to which it belongs, one after the other."""

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._handling = Handling(self.walker, self.task.world)
        self._chosen: Prop | None = None

    def act(self, observation: Mapping[str, NDArray[Any]]) -> WalkCommand:
        """Return a command for a walker, see `Expert.act`."""
        held = self.walker.held
        return self._fetch() if held is None else self._bring(held)

    @property
    @abstractmethod
    def walker(self) -> Walker:
        """The body."""

    @abstractmethod
    def waiting(self) -> list[Prop]:
        """Return the props that are not yet in their containers."""

    @abstractmethod
    def container_of(self, prop: Prop) -> Prop:
        """Return the container to which a prop belongs."""

    def _fetch(self) -> WalkCommand:
        """Go to the nearest waiting prop; grab it, or another waiting one that is within reach."""
        waiting = self.waiting()
        if self._handling.target("grab") in waiting:
            self._chosen = None
            return self._handling.apply("grab")
        if self._chosen not in waiting:
            self._chosen = min(waiting, key=self._distance_m, default=None)
        if self._chosen is None:
            return WalkCommand(0.0, 0.0)
        return self._handling.approach(self._chosen)

    def _bring(self, held: Prop) -> WalkCommand:
        """Go to the container of what is held, and put it in."""
        container = self.container_of(held)
        if self._handling.target("put_into") is container:
            return self._handling.apply("put_into")
        return self._handling.approach(container)

    def _distance_m(self, prop: Prop) -> float:
        return horizontal_distance(self.walker.position, prop.position)
