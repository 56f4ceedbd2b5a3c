"""Expert of PutDownBlock: carry the red block from the tower to the floor."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.carrying import CarryCfg, carry, return_to_rest
from veca_marl.envs.experts.control.palm_motion import PalmMotion
from veca_marl.envs.experts.objects.carrying_expert import CarryingExpert
from veca_marl.envs.tasks.objects.put_down_block import PutDownBlock
from veca_marl.sim.body.humanoid.postures import reaching
from veca_marl.sim.geometry import Floats

# a weak grip: with a force of 10 N the palms push the tower forwards by 20 mm
_CARRY = CarryCfg(squeeze_m=0.012, above_m=0.02, over_m=(0.03, 0.02, 0.03))
_CLEARANCE_M = 0.035  # of the carried block above the tower
_ASIDE_M = 0.11  # distance of its goal from the sagittal plane of the child
# of the postures that were tried, these knock over the fewest towers
_UPRIGHT, _BENT = reaching(20.0, 20.0), reaching(30.0, 22.0)


@register_expert("PutDownBlock")
class PutDownBlockExpert(CarryingExpert[PutDownBlock]):
    """Presses the red block between both palms, lifts it off and puts it on the floor beside.

    Starts again after losing the block, until the task is solved after a release: from then on its
    hands rest. Reads the poses of the blocks and of its own bones, whether the task is solved, and
    the angles, velocities and strengths of its joints from the simulator (privileged); with
    position control also the forces on its joints. Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: PutDownBlock, player: Player) -> None:
        step_s = task.world.clock.step_s
        palms = PalmMotion(task.child, step_s, _UPRIGHT, _BENT, posture_gain_per_s=0.25)
        super().__init__(task, player, palms)

    def _script(self) -> Iterator[Floats]:
        cfg = self.task.cfg
        height_m = (cfg.blue + 0.5) * cfg.edge_m + _CLEARANCE_M
        while not self.task.solved(self.player):
            yield from carry(self._palms, self.task.red, self._goal, height_m, _CARRY)
        yield from return_to_rest(self._palms)

    def _goal(self) -> Floats:
        """Return a place on the floor on the other side of the child, ``(3,)`` metres."""
        x, y, _ = self.task.blue[0].position
        return np.array([x, -math.copysign(_ASIDE_M, y), self.task.cfg.edge_m / 2])
