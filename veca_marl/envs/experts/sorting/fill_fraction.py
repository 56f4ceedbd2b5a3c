"""Expert of FillFraction."""

from __future__ import annotations

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.experts.sorting.putting_expert import PuttingExpert
from veca_marl.envs.tasks.sorting.circles import division
from veca_marl.envs.tasks.sorting.fill_fraction import FillFraction
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.physics import Prop


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
