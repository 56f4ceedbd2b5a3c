"""PileUpBlock: put one block on top of another."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.objects.blocks import (
    RED,
    BlocksCfg,
    add_block,
    height_in_edges,
    is_released,
    rests_on,
)
from veca_marl.sim.body.humanoid.postures import REACHING


@dataclass
class PileUpBlockCfg(BlocksCfg):
    """Parameters of PileUpBlock. The pelvis is at the origin and the body faces +x.

    Attributes:
        ahead_m: Least and greatest distance of a block in front of the pelvis.
        aside_m: Least and greatest lateral distance; one block is on the left, one on the right.
        turn_deg: Largest yaw of a block.
    """

    max_seconds: float = 12.0
    ahead_m: tuple[float, float] = (0.22, 0.28)
    aside_m: tuple[float, float] = (0.07, 0.1)
    turn_deg: float = 10.0
    weights: dict[str, float] = terms(height=0.04)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("ahead_m", "aside_m"):
            near, far = getattr(self, name)
            if not self.edge_m < near <= far < math.inf:
                raise ValueError(
                    f"task.{name}={(near, far)} must be (least, greatest), above task.edge_m"
                )


@register
class PileUpBlock(Task):
    """A joint-level body sits in front of two red blocks and has to put one on the other.

    The senses, the joint-level action and the reward, "the sum of the y-axis position of red
    blocks" (the vertical axis), are those of the paper (table of tasks in the appendix); the
    number of blocks and all numbers are not in the paper. By the paper's rule a block that is held
    up is rewarded like one that lies on another, and more the higher it is held.

    The body is free and can topple. An episode lasts `max_seconds` and never terminates. The task
    is solved (`solved`) while one block rests on the other and no part of the body touches it.

    Terms:
        height: Sum of the heights of the red blocks above the floor, in lengths of their edge. Its
            default weight is the duration of a step in seconds, so that a block on top of another
            adds 1 per second to the return.
    """

    senses = ("vision", "touch", "proprioception")
    cfg: PileUpBlockCfg

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.blocks = [add_block(self.world, self.cfg, f"red_{i}", RED) for i in range(2)]

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        for block, side in zip(self.blocks, (1.0, -1.0), strict=True):
            ahead, aside = rng.uniform(*self.cfg.ahead_m), rng.uniform(*self.cfg.aside_m)
            yaw = math.radians(rng.uniform(-self.cfg.turn_deg, self.cfg.turn_deg))
            block.place((ahead, side * aside, self.cfg.edge_m / 2), yaw)

    def reward(self, player: Player) -> dict[str, float]:
        return {"height": sum(height_in_edges(block) for block in self.blocks)}

    def solved(self, player: Player) -> bool:
        """Return whether one block rests on the other and has been released."""
        return any(
            rests_on(block, base) and is_released(block, self.child)
            for block, base in itertools.permutations(self.blocks)
        )
