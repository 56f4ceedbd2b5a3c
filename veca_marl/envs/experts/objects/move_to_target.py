"""Expert of MoveToTarget: carry the toy to the mark."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.core.scoring import horizontal
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.carrying import CarryCfg, carry, return_to_rest
from veca_marl.envs.experts.control.palm_motion import PalmMotion
from veca_marl.envs.experts.objects.carrying_expert import CarryingExpert
from veca_marl.envs.tasks.objects.move_to_target import MoveToTarget
from veca_marl.sim.geometry import Floats

_CLEARANCE_M = 0.03  # of the carried toy above the floor


@register_expert("MoveToTarget")
class MoveToTargetExpert(CarryingExpert[MoveToTarget]):
    """Presses the toy between both palms, carries it over the mark and releases it.

    Starts again after losing the toy, until a released toy is on the mark: from then on its hands
    rest. Reads the poses of the toy, the mark and its own bones, and the angles, velocities and
    strengths of its joints from the simulator (privileged); with position control also the forces
    on its joints. Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: MoveToTarget, player: Player) -> None:
        super().__init__(task, player, PalmMotion(task.child, task.world.clock.step_s))

    def _script(self) -> Iterator[Floats]:
        cfg = self.task.cfg
        height_m = cfg.edge_m / 2 + _CLEARANCE_M
        while not self.task.distance_m < 0.5 * cfg.solved_m:
            yield from carry(self._palms, self.task.toy, self._goal, height_m, CarryCfg())
        yield from return_to_rest(self._palms)

    def _goal(self) -> Floats:
        """Return the centre of a toy that lies on the mark, ``(3,)`` metres."""
        height = np.array([0.0, 0.0, self.task.cfg.edge_m / 2])
        goal: Floats = horizontal(self.task.mark.position) + height
        return goal
