"""Experts of the tasks with a toy: GrabObject and MoveToTarget."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.scoring import horizontal
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.skills.carrying import Carrier
from veca_marl.envs.experts.skills.lifting import BENT, UPRIGHT, lift
from veca_marl.envs.tasks.objects.grab_object import GrabObject
from veca_marl.envs.tasks.objects.move_to_target import MoveToTarget
from veca_marl.sim.geometry import Floats

_LIFT_M = 0.10
_CARRY_CLEARANCE_M = 0.03


@register_expert("GrabObject")
class GrabObjectExpert(Expert[GrabObject]):
    """Presses the toy between both palms and lifts it; starts again after losing it.

    Reads the poses of the toy and of its own bones from the simulator (privileged).
    """

    reads = ()

    def __init__(self, task: GrabObject, player: Player) -> None:
        super().__init__(task, player)
        self._carrier = Carrier(task.child, upright=UPRIGHT, bent=BENT, posture_gain=0.01)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._carrier.reset()
        height_m = self.task.cfg.edge_m / 2 + _LIFT_M
        self._commands = lift(self.task.child, self._carrier, self.task.toy, height_m)

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)


@register_expert("MoveToTarget")
class MoveToTargetExpert(Expert[MoveToTarget]):
    """Presses the toy between both palms, carries it over the mark and releases it.

    Starts again after losing the toy. Reads the poses of the toy, the mark and its own bones from
    the simulator (privileged).
    """

    reads = ()

    def __init__(self, task: MoveToTarget, player: Player) -> None:
        super().__init__(task, player)
        self._carrier = Carrier(task.child)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._carrier.reset()
        self._commands = self._script()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)

    def _script(self) -> Iterator[Floats]:
        cfg = self.task.cfg
        carry_m = cfg.edge_m / 2 + _CARRY_CLEARANCE_M
        while not self.task.distance_m < 0.5 * cfg.there_m:
            yield from self._carrier.carry(self.task.toy, self._goal, carry_m)
        yield from self._carrier.rest()

    def _goal(self) -> Floats:
        """Return the centre of a toy that lies on the mark, ``(3,)`` metres."""
        height = np.array([0.0, 0.0, self.task.cfg.edge_m / 2])
        goal: Floats = horizontal(self.task.mark.position) + height
        return goal
