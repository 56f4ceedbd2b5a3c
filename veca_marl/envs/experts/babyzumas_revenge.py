"""Expert of BabyzumasRevenge."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.experts.control.handling import Handling
from veca_marl.envs.tasks.babyzumas_revenge import OPEN, BabyzumasRevenge
from veca_marl.sim.body.walker import WalkCommand
from veca_marl.sim.geometry import Floats

_BEFORE_M = 1.1  # from the middle of the cupboard: the drawer opens without touching the body
_AT_DRAWER_M = 0.67  # near enough to look into the open drawer
_BEYOND_M = 0.8


@register_expert("BabyzumasRevenge")
class BabyzumasRevengeExpert(Expert[BabyzumasRevenge]):
    """Opens the drawer, takes the key, opens the door, and goes into the next room.

    Reads privileged state: its own position and heading, the poses of cupboard and door, how far
    drawer and door are open, what its verbs would be applied to, and for its paths the rooms, the
    poses and sizes of all fixed props, and which props are light.
    """

    reads = ()

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._handling = Handling(self.task.walker, self.task.world)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> WalkCommand:
        """Return a command for a walker, see `Expert.act`."""
        task = self.task
        if task.door.opening >= OPEN:
            return self._handling.walk_to(task.doorway + _BEYOND_M * task.out[:2])
        if task.walker.held is task.key:
            return self._open_door()
        return self._open_drawer() if task.drawer.opening < OPEN else self._take_key()

    def _open_door(self) -> WalkCommand:
        if self._handling.target("open") is self.task.door:
            return self._handling.apply("open")
        return self._handling.approach(self.task.door)

    def _open_drawer(self) -> WalkCommand:
        place = self._before_cupboard(_BEFORE_M)
        if self._handling.target("open") is self.task.drawer:
            return self._handling.apply("open")
        return self._handling.stand_at(place, self.task.cupboard.position)

    def _take_key(self) -> WalkCommand:
        if self._handling.target("grab") is self.task.key:
            return self._handling.apply("grab")
        return self._handling.stand_at(
            self._before_cupboard(_AT_DRAWER_M), self.task.cupboard.position
        )

    def _before_cupboard(self, distance_m: float) -> Floats:
        """Return a place in front of the middle of the cupboard."""
        cupboard = self.task.cupboard
        place: Floats = cupboard.position + distance_m * cupboard.rotation[:, 0]
        return place
