"""Experts of the tasks with blocks: PileUpBlock and PutDownBlock."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.expert import Expert, register_expert
from veca_marl.envs.core.task import Player
from veca_marl.envs.experts.skills.carrying import Carrier
from veca_marl.envs.tasks.objects.pile_up_block import PileUpBlock
from veca_marl.envs.tasks.objects.put_down_block import PutDownBlock
from veca_marl.sim.body.humanoid.postures import reaching
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop

_CARRY_CLEARANCE_M = 0.02
_PUT_DOWN_ASIDE_M = 0.09
# postures for PutDownBlock: of the ones tried, these knock over the fewest towers
_UPRIGHT, _BENT = reaching(20.0, 20.0), reaching(30.0, 22.0)


@register_expert("PileUpBlock")
class PileUpBlockExpert(Expert[PileUpBlock]):
    """Presses a red block between both palms, carries it over the other one and releases it.

    Starts again after losing the block. Reads the poses of the blocks and of its own bones from
    the simulator (privileged).
    """

    reads = ()

    def __init__(self, task: PileUpBlock, player: Player) -> None:
        super().__init__(task, player)
        self._carrier = Carrier(
            task.child, squeeze_m=0.025, carrying_m=0.005, thumbs_m=0.005, posture_gain=0.01
        )

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._carrier.reset()
        self._commands = self._script()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)

    def _script(self) -> Iterator[Floats]:
        carry_m = 1.5 * self.task.cfg.edge_m + _CARRY_CLEARANCE_M
        for block, base in itertools.cycle(itertools.permutations(self.task.red)):
            if self.task.solved(self.player):
                yield from self._carrier.rest()
            yield from self._carrier.carry(block, partial(_on_top_of, base), carry_m)


@register_expert("PutDownBlock")
class PutDownBlockExpert(Expert[PutDownBlock]):
    """Presses the red block between both palms, lifts it off and puts it on the floor beside.

    Reads the poses of the blocks and of its own bones from the simulator (privileged).
    """

    reads = ()

    def __init__(self, task: PutDownBlock, player: Player) -> None:
        super().__init__(task, player)
        self._carrier = Carrier(task.child, upright=_UPRIGHT, bent=_BENT)

    def reset(self) -> None:
        """See `Expert.reset`."""
        self._carrier.reset()
        self._commands = self._script()

    def act(self, observation: Mapping[str, NDArray[Any]]) -> Floats:
        """Return target angles ``(82,)`` in rad."""
        return next(self._commands)

    def _script(self) -> Iterator[Floats]:
        cfg = self.task.cfg
        carry_m = (cfg.blue + 0.5) * cfg.edge_m + _CARRY_CLEARANCE_M
        while not self.task.solved(self.player):
            yield from self._carrier.carry(self.task.red, self._goal, carry_m, above_m=0.02)
        yield from self._carrier.rest()

    def _goal(self) -> Floats:
        """Return a place on the floor on the other side of the child, ``(3,)`` metres."""
        x, y, _ = self.task.blue[0].position
        return np.array([x, -math.copysign(_PUT_DOWN_ASIDE_M, y), self.task.cfg.edge_m / 2])


def _on_top_of(base: Prop) -> Floats:
    """Return the centre of a block that lies on another one, ``(3,)`` metres."""
    x, y, z = base.position
    return np.array([x, y, z + base.cfg.size_m[0]])
