"""PileUpBlock: put one block on top of another."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Player, Task, register_task, require_humanoid, terms
from veca_marl.envs.tasks.objects.toys_and_blocks import (
    BLUE,
    RED,
    BlocksCfg,
    add_block,
    check_seat,
    height_in_edges,
    is_at_rest,
    rests_on,
    stands_free,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import REACHING
from veca_marl.sim.physics import PlaygroundCfg, Prop


@dataclass
class PileUpBlockCfg(BlocksCfg):
    """Parameters of PileUpBlock. The pelvis is at the origin and the body faces +x.

    Attributes:
        ahead_m: Least and greatest distance of a red block in front of the pelvis.
        aside_m: Least and greatest lateral distance; one red block is on the left, one on the
            right.
        blue_ahead_m: Least and greatest distance of the blue block in front of the pelvis.
        blue_aside_m: Largest lateral distance of the blue block.
        turn_deg: Largest yaw of a block.
    """

    max_seconds: float = 12.0
    ahead_m: tuple[float, float] = (0.22, 0.28)
    aside_m: tuple[float, float] = (0.07, 0.1)
    blue_ahead_m: tuple[float, float] = (0.34, 0.37)
    blue_aside_m: float = 0.03
    turn_deg: float = 10.0
    weights: dict[str, float] = terms(height=0.04, lift=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("ahead_m", "aside_m"):
            self._check_span(name, self.edge_m, "at least task.edge_m")
        self._check_span("blue_ahead_m", self.ahead_m[1] + self.edge_m, "behind the red blocks")
        self.check_not_negative("blue_aside_m", "turn_deg")


@register_task
class PileUpBlock(Task):
    """A joint-level body sits in front of three blocks and has to pile up the red ones.

    One red block is on the left, one on the right, and a blue block is behind them. The height of
    the blue block is not rewarded; a red block may be put on it.

    The senses and the joint-level action are those of the paper (table of tasks in the appendix).
    The reward in the paper is "the sum of the y-axis position of red blocks" (the vertical axis):
    by this rule a block that is held up is rewarded like one that lies on another, and more the
    higher it is held. Departures: `height` counts red blocks that rest and have been released, with
    all blocks that carry them: otherwise a red block that lies on one held up would be rewarded
    more the higher it is held. `lift` rewards raising a block once. The number of blocks, the blue
    one and all numbers are not in the paper.

    The body is free and can topple. An episode lasts `max_seconds` and never terminates. The task
    is solved (`solved`) while a red block rests on another block and no part of the body touches
    the red one or a block that carries it. Bullet solves contacts with 30 iterations
    (`clock.solver_iterations`): with the default of 10 a block that lies on another one creeps by
    1 mm/s.

    Terms:
        height: Sum of the heights above the floor of the lowest corners of the red blocks that are
            at rest and that no part of the body touches, nor a block that carries them, in lengths
            of their edge. With the default weight a block on top of another adds 1 per second to
            the return.
        lift: Increase during the step of the sum of the heights of the red blocks, each clipped to
            [0, 1] edge, held or not. It is the difference of a potential: putting a block down
            again takes the reward back.
    """

    senses = ("vision", "touch", "proprioception")
    rates = ("height",)
    body_cfg = HumanoidCfg
    ages_months = None  # positions and sizes of things are for these arms and hands
    cfg: PileUpBlockCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        asked = ", ".join(
            f"task.{name}={getattr(cfg, name)}"
            for name in ("ahead_m", "aside_m", "blue_ahead_m", "blue_aside_m")
        )
        ahead_m = max(cfg.ahead_m[1], cfg.blue_ahead_m[1])
        aside_m = max(cfg.aside_m[1], cfg.blue_aside_m)
        check_seat(cls.__name__, playground, ahead_m, aside_m, cfg.edge_m, asked)

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.red = [add_block(self.world, self.cfg, f"red_{i}", RED) for i in range(2)]
        self.blue = add_block(self.world, self.cfg, "blue", BLUE)
        self._raised = self._lift = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        cfg = self.cfg
        for red, side in zip(self.red, (1.0, -1.0), strict=True):
            self._place(red, rng.uniform(*cfg.ahead_m), side * rng.uniform(*cfg.aside_m), rng)
        aside = rng.uniform(-cfg.blue_aside_m, cfg.blue_aside_m)
        self._place(self.blue, rng.uniform(*cfg.blue_ahead_m), aside, rng)
        self._raised, self._lift = self._raised_edges(), 0.0

    def _place(self, block: Prop, ahead: float, aside: float, rng: np.random.Generator) -> None:
        yaw = math.radians(rng.uniform(-self.cfg.turn_deg, self.cfg.turn_deg))
        block.place((ahead, aside, self.cfg.edge_m / 2), yaw)

    def after_step(self, rng: np.random.Generator) -> None:
        raised = self._raised_edges()
        self._lift, self._raised = raised - self._raised, raised

    def reward(self, player: Player) -> dict[str, float]:
        piled = [block for block in self.red if self._rests(block)]
        return {"height": sum(max(height_in_edges(b), 0.0) for b in piled), "lift": self._lift}

    def _raised_edges(self) -> float:
        return sum(min(max(height_in_edges(block), 0.0), 1.0) for block in self.red)

    def solved(self, player: Player) -> bool:
        """Return whether a red block rests on another block and the pile has been released."""
        return any(
            rests_on(block, base) and self._stands_free(block)
            for block in self.red
            for base in (*self.red, self.blue)
            if base is not block
        )

    def _rests(self, block: Prop) -> bool:
        """Return whether a block lies on the floor or on other blocks, untouched and at rest.

        A block that was thrown is as slow for a moment at the highest point of its path.
        """
        carriers = (self.world.floor_id, *(each.body_id for each in (*self.red, self.blue)))
        lies = any(block.touches(body) for body in carriers if body != block.body_id)
        return lies and is_at_rest(block) and self._stands_free(block)

    def _stands_free(self, block: Prop) -> bool:
        return stands_free(block, (*self.red, self.blue), self.child)
