"""PutDownBlock: take the red block off a tower without knocking over the blue ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Player, Task, register_task, require_humanoid, terms
from veca_marl.envs.tasks.objects.toys_and_blocks import (
    BLUE,
    RED,
    START_GAP_M,
    BlocksCfg,
    add_block,
    check_seat,
    height_in_edges,
    is_at_rest,
    is_released,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import REACHING
from veca_marl.sim.physics import PlaygroundCfg

_LEAN = 2.0 / 3.0  # of the front of a body that is `REACHING`: metres ahead per metre of height
# height in edges times seconds, with two blue blocks and 12 s, if nothing is done
_DEFAULT_EDGE_SECONDS = 24.0


@dataclass
class PutDownBlockCfg(BlocksCfg):
    """Parameters of PutDownBlock. The pelvis is at the origin and the body faces +x.

    Attributes:
        blue: Number of blue blocks in the tower, 2 or 3.
        ahead_m: Least and greatest distance of the tower in front of the pelvis; above two thirds
            of the height of the tower, where the trunk that leans over it ends.
        aside_m: Least and greatest lateral distance of the tower, to the left or to the right.
        turn_deg: Largest yaw of the tower.
        fallen: Loss of height, in lengths of an edge, at which a blue block has fallen, in (0, 1).
    """

    max_seconds: float = 12.0
    blue: int = 2
    ahead_m: tuple[float, float] = (0.23, 0.27)
    aside_m: tuple[float, float] = (0.05, 0.08)
    turn_deg: float = 10.0
    fallen: float = 0.5
    weights: dict[str, float] = terms(height=-0.04, blue_fell=-30.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.blue not in (2, 3):
            raise ValueError(f"task.blue={self.blue} must be 2 or 3, so that one can fall")
        self.check_not_negative("turn_deg")
        least_m = self._least_ahead_m()
        self._check_span(
            "ahead_m",
            least_m,
            f"at least {least_m:.3f}: the trunk leans over a tower of task.blue={self.blue} and a "
            f"red block of task.edge_m={self.edge_m:g}",
        )
        self._check_span("aside_m", 0.0, "0 or more")
        if not 0.0 < self.fallen < 1.0:
            raise ValueError(f"task.fallen={self.fallen} must be between 0 and 1 edges")

    def _least_ahead_m(self) -> float:
        """Return the distance from which on a tower in the middle is clear of the trunk."""
        height_m = (self.blue + 1) * self.edge_m
        return _LEAN * height_m + self.edge_m / 2.0


@register_task
class PutDownBlock(Task):
    """A joint-level body has to take a red block off a tower of blue ones, to the floor.

    The senses, the joint-level action and the reward, "the negative sum of the y-axis position of
    red blocks" (the vertical axis) and "a negative reward when the blue blocks fall", are those of
    the paper (table of tasks in the appendix); the tower and all numbers are not in the paper.
    Departure: there is one red block. A height is that of a block's lowest corner.

    The body is free and can topple. An episode lasts `max_seconds` and never terminates. The task
    is solved (`solved`) while the red block rests on the floor, no part of the body touches it and
    no blue block has fallen. Bullet solves contacts with 30 iterations
    (`clock.solver_iterations`), as in PileUpBlock.

    Terms:
        height: Height of the red block above the floor, in lengths of its edge. With the default
            weight the red block on two blue ones adds -2 per second to the return.
        blue_fell: Number of blue blocks that have fallen in this step, each once; 1 for each with
            the default tower and duration, else in proportion to `blue` times `max_seconds`. With
            the default weights one costs 1.25 times as much as a red block that stays on the tower
            for the whole episode, so that tearing the tower down is worse than doing nothing.
    """

    senses = ("vision", "touch", "proprioception")
    rates = ("height",)
    body_cfg = HumanoidCfg
    ages_months = None  # positions and sizes of things are for these arms and hands
    cfg: PutDownBlockCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        asked = f"task.ahead_m={tuple(cfg.ahead_m)}, task.aside_m={tuple(cfg.aside_m)}"
        check_seat(cls.__name__, playground, cfg.ahead_m[1], cfg.aside_m[1], cfg.edge_m, asked)

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
        y = rng.choice((-1.0, 1.0)) * rng.uniform(*self.cfg.aside_m)
        x = rng.uniform(*self.cfg.ahead_m)
        yaw = math.radians(rng.uniform(-self.cfg.turn_deg, self.cfg.turn_deg))
        for level, block in enumerate((*self.blue, self.red)):
            block.place((x, y, (level + 0.5) * self.cfg.edge_m + START_GAP_M * level), yaw)
        self._fallen, self._newly_fallen = set(), 0

    def after_step(self, rng: np.random.Generator) -> None:
        fallen = {
            block.name
            for level, block in enumerate(self.blue)
            if level > 0 and height_in_edges(block) < level - self.cfg.fallen
        }
        self._newly_fallen = len(fallen - self._fallen)
        self._fallen |= fallen

    def reward(self, player: Player) -> dict[str, float]:
        lost = self._newly_fallen * self.cfg.blue * self.cfg.max_seconds / _DEFAULT_EDGE_SECONDS
        return {"height": height_in_edges(self.red), "blue_fell": lost}

    def state(self) -> dict[str, float]:
        return {"fallen": float(len(self._fallen))}

    def solved(self, player: Player) -> bool:
        """Return whether the red block is released on the floor and all blue ones stand."""
        on_floor = abs(height_in_edges(self.red)) < 0.1 and is_at_rest(self.red)
        return on_floor and is_released(self.red, self.child) and not self._fallen
