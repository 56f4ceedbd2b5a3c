"""Experts of ColorSort, ShapeSort and FillFraction: props are put into containers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, TypeVar

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Task
from veca_marl.envs.experts.control.handling import Handling
from veca_marl.envs.tasks.sorting.fill_fraction import FillFraction, division
from veca_marl.envs.tasks.sorting.sorting_task import SortingTask
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


@register_expert("ColorSort")
@register_expert("ShapeSort")
class SortingExpert(PuttingExpert[SortingTask]):
    """Takes the nearest toy to its basket, one after the other.

    Reads privileged state: its own position and heading, the positions and categories of all toys
    and baskets, which toys are in which baskets, what its verbs would be applied to, and for its
    paths the rooms, the poses and sizes of all fixed props, and which props are light.
    """

    @property
    def walker(self) -> Walker:
        """See `PuttingExpert`."""
        return self.task.walker

    def waiting(self) -> list[Prop]:
        """Return the toys that are not in their baskets."""
        items = self.task.items
        return [items[n].prop for n in range(len(items)) if not self.task.is_sorted(n)]

    def container_of(self, prop: Prop) -> Prop:
        """Return the basket of a toy."""
        number = [item.prop for item in self.task.items].index(prop)
        return self.task.baskets[self.task.category[number]].prop


@register_expert("FillFraction")
class FillFractionExpert(PuttingExpert[FillFraction]):
    """Divides the pieces among the circles, then takes one after the other to its circle.

    Reads privileged state: its own position and heading, the positions and sizes of all pieces, the
    positions of the circles, which pieces are in which circles, what its verbs would be applied to,
    and for its paths the rooms, the poses and sizes of all fixed props, and which props are light.
    """

    def reset(self) -> None:
        """See `Expert.reset`."""
        super().reset()
        self._circles = division(self.task.cfg.pieces, len(self.task.circles)) or []

    @property
    def walker(self) -> Walker:
        """See `PuttingExpert`."""
        return self.task.walker

    def waiting(self) -> list[Prop]:
        """Return the pieces that are in no circle."""
        laid = [piece.prop for circle in self.task.circles for piece in circle.content]
        return [piece.prop for piece in self.task.pieces if piece.prop not in laid]

    def container_of(self, prop: Prop) -> Prop:
        """Return the circle of a piece."""
        number = [piece.prop for piece in self.task.pieces].index(prop)
        return self.task.circles[self._circles[number]].prop
