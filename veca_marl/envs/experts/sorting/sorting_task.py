"""Expert of ColorSort and ShapeSort."""

from __future__ import annotations

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.experts.sorting.putting_expert import PuttingExpert
from veca_marl.envs.tasks.sorting.sorting_task import SortingTask
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.physics import Prop


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
