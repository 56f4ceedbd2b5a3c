"""Expert of PileUpBlock: carry a red block over the other one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np

from veca_marl.envs.core.expert import register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.control.carrying import CarryCfg, carry, return_to_rest
from veca_marl.envs.experts.control.palm_motion import Grip, PalmMotion
from veca_marl.envs.experts.objects.carrying_expert import CarryingExpert
from veca_marl.envs.tasks.objects.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.objects.toys_and_blocks import height_in_edges
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop

_SETTLING_S, _PILED_EDGES = 1.2, 0.5
_CLEARANCE_M = 0.035  # of the carried block above the other one
# high palms, since thumbs that press on the rear edge tilt the block by 20 to 40 degrees
_CARRY = CarryCfg(squeeze_m=0.025, speed_mps=0.125, thumbs_m=0.012, levelling_per_s=2.5)


@register_expert("PileUpBlock")
class PileUpBlockExpert(CarryingExpert[PileUpBlock]):
    """Presses a red block between both palms, carries it over the other one and releases it.

    Starts again after losing the block, until the task is solved for the first time after a
    release: from then on its hands rest, also if the pile falls later. Reads the poses of the
    blocks and of its own bones, whether the task is solved, and the angles, velocities and
    strengths of its joints from the simulator (privileged); with position control also the forces
    on its joints. Plays at control rates from 21 to 245 Hz.
    """

    def __init__(self, task: PileUpBlock, player: Player) -> None:
        super().__init__(
            task, player, PalmMotion(task.child, task.world.clock.step_s, posture_gain_per_s=0.25)
        )

    def _script(self) -> Iterator[Floats]:
        height_m = 1.5 * self.task.cfg.edge_m + _CLEARANCE_M
        for block, base in itertools.cycle(itertools.permutations(self.task.red)):
            yield from carry(self._palms, block, partial(_on_top_of, base), height_m, _CARRY)
            yield from self._let_settle(block)
            if self.task.solved(self.player):
                yield from return_to_rest(self._palms)

    def _let_settle(self, block: Prop) -> Iterator[Floats]:
        """Hold the hands still while a block that has been put down still moves.

        A pile sways after it was released: it is not solved yet, but must not be gripped.
        """
        here = Grip(self._palms.middle, self._palms.gap_m)
        for _ in range(self._palms.steps(_SETTLING_S)):
            if self.task.solved(self.player) or height_in_edges(block) < _PILED_EDGES:
                return
            yield self._palms.move(here)


def _on_top_of(base: Prop) -> Floats:
    """Return the centre of a block that lies on another one, ``(3,)`` metres."""
    x, y, z = base.position
    return np.array([x, y, z + base.cfg.size_m[0]])
