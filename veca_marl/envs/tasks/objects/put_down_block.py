"""PutDownBlock: take the red block down and leave the blue ones standing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.objects.blocks import (
    BLUE,
    RED,
    BlocksCfg,
    add_block,
    height,
    is_free,
    is_still,
)
from veca_marl.sim.body.humanoid.postures import REACHING


@dataclass
class PutDownBlockCfg(BlocksCfg):
    """Where the tower stands before the child, whose pelvis is at the origin and faces x.

    Attributes:
        blue: How many blue blocks the tower has.
        ahead_m: Least and greatest distance of the tower ahead of the child.
        aside_m: Least and greatest distance of the tower to its left or right side.
        turn_deg: The tower is turned by so much at most.
        fallen: A blue block has fallen when it is so many edges lower than it was (the lowest
            cannot fall).
    """

    max_seconds: float = 12.0
    blue: int = 2
    ahead_m: tuple[float, float] = (0.23, 0.27)
    aside_m: tuple[float, float] = (0.05, 0.08)
    turn_deg: float = 10.0
    fallen: float = 0.5
    weights: dict[str, float] = terms(height=-0.04, blue_fell=-20.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.blue not in (2, 3):
            raise ValueError(f"task.blue={self.blue}: 2 or 3, one that can fall, within reach")
        for name in ("ahead_m", "aside_m"):
            near, far = getattr(self, name)
            if not 0.0 <= near <= far < math.inf:
                raise ValueError(f"task.{name}={(near, far)} must be (least, greatest), 0 or more")
        if not 0.0 < self.fallen < 1.0:
            raise ValueError(f"task.fallen={self.fallen} must be between 0 and 1 edges")


@register
class PutDownBlock(Task):
    """A child sits before a tower of blue blocks with a red one on top: put the red one down.

    The paper gives the senses, the joint-level action and the reward, "the negative sum of the
    vertical position of red blocks" and "negative reward when blue blocks fall"; the tower and all
    numbers are ours. The child is free: it may topple. An episode lasts 12 s and never ends early.
    It is solved (`solved`) while the red block lies still on the floor, no part of the child
    touches it, and no blue block has fallen.

    Terms:
        height: how high the red block is above its place on the floor, in edges of a block. Its
            weight is minus the duration of a step: on top of two blue blocks it costs 2 per second.
        blue_fell: the number of blue blocks that fell in this step; each falls once. One costs
            nearly as much as leaving the red block up for the whole episode.
    """

    senses = ("vision", "touch", "proprioception")
    cfg: PutDownBlockCfg

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.blue = [
            add_block(self.world, self.cfg, f"blue_{i}", BLUE) for i in range(self.cfg.blue)
        ]
        self.red = add_block(self.world, self.cfg, "red", RED)
        self._fallen: set[str] = set()
        self._newly_fallen = 0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        aside = rng.choice((-1.0, 1.0)) * rng.uniform(*self.cfg.aside_m)
        ahead = rng.uniform(*self.cfg.ahead_m)
        turn = math.radians(rng.uniform(-self.cfg.turn_deg, self.cfg.turn_deg))
        # not touching at first: Bullet's contacts would remember the last episode
        for floor, block in enumerate((*self.blue, self.red)):
            block.place((ahead, aside, (floor + 0.5) * self.cfg.edge_m + 0.002 * floor), turn)
        self._fallen, self._newly_fallen = set(), 0

    def after_step(self, rng: np.random.Generator) -> None:
        down = {
            block.name
            for floor, block in enumerate(self.blue)
            if floor > 0 and height(block) < floor - self.cfg.fallen
        }
        self._newly_fallen = len(down - self._fallen)
        self._fallen |= down

    def reward(self, player: Player) -> dict[str, float]:
        return {"height": height(self.red), "blue_fell": float(self._newly_fallen)}

    @property
    def solved(self) -> bool:
        """Whether the red block lies on the floor by itself and all blue ones stand."""
        down = abs(height(self.red)) < 0.1 and is_still(self.red)
        return down and is_free(self.red, self.child) and not self._fallen
