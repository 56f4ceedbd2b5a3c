"""PileUpBlock: put one block on the other."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.objects.blocks import RED, BlocksCfg, add_block, height, is_free, rests_on
from veca_marl.sim.body.humanoid.postures import REACHING


@dataclass
class PileUpBlockCfg(BlocksCfg):
    """Where the blocks lie before the child, whose pelvis is at the origin and faces x.

    Attributes:
        ahead_m: Least and greatest distance of a block ahead of the child.
        aside_m: Least and greatest distance of a block to its side: one left, one right.
        turn_deg: A block is turned by so much at most.
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
    """A child sits on the floor with two red blocks before it: pile them up.

    The paper gives the senses, the joint-level action and the reward, "the sum of the vertical
    position of red blocks"; all numbers are ours. There are no helper rewards. By the paper's rule
    a block that is held up is worth as much as one that lies on another, and more if held higher.
    The child is free: it may topple. An episode lasts 12 s and never ends early. It is solved
    (`solved`) while a block lies still on the other and no part of the child touches it.

    Terms:
        height: how high the red blocks are above their places on the floor, in edges of a block,
            summed over the blocks. Its weight is the duration of a step: a block that lies on the
            other earns 1 per second.
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
            turn = math.radians(rng.uniform(-self.cfg.turn_deg, self.cfg.turn_deg))
            block.place((ahead, side * aside, self.cfg.edge_m / 2), turn)

    def reward(self, player: Player) -> dict[str, float]:
        return {"height": sum(height(block) for block in self.blocks)}

    @property
    def solved(self) -> bool:
        """Whether one block lies on the other by itself."""
        return any(
            rests_on(one, other) and is_free(one, self.child)
            for one, other in itertools.permutations(self.blocks)
        )
