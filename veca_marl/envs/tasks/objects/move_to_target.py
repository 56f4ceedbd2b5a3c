"""MoveToTarget: move a toy to a mark on the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import (
    Player,
    Task,
    horizontal,
    register_task,
    require_humanoid,
    terms,
)
from veca_marl.envs.tasks.objects.toys_and_blocks import ToyCfg, add_toy, check_seat, place_toy
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import REACHING
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape

_MARK_HEIGHT_M = 0.001


@dataclass
class MoveToTargetCfg(ToyCfg):
    """Parameters of MoveToTarget.

    Attributes:
        target_m: Least and greatest distance of the mark from the toy at the start, to the left or
            to the right.
        clip_m: Distance between toy and mark at which the distance is clipped.
        solved_m: Distance between toy and mark up to which the task is solved.
    """

    max_seconds: float = 10.0
    aside_m: float = 0.0
    target_m: tuple[float, float] = (0.08, 0.12)
    clip_m: float = 0.15
    solved_m: float = 0.05
    weights: dict[str, float] = terms(progress=10.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        near, far = self.target_m
        if not self.solved_m > 0.0:
            raise ValueError(f"task.solved_m={self.solved_m} must be positive")
        if not self.solved_m < near <= far < math.inf:
            raise ValueError(
                f"task.target_m={(near, far)} must be (least, greatest), above "
                f"task.solved_m={self.solved_m}"
            )
        if not far <= self.clip_m < math.inf:
            raise ValueError(
                f"task.clip_m={self.clip_m} must be at least task.target_m={(near, far)}"
            )


@register_task
class MoveToTarget(Task):
    """A joint-level body sits on the floor and has to move a toy to a green mark.

    The mark is a disc on the floor without collision. The senses, the joint-level action and the
    reward, "the difference of distance between the target position and the object's position",
    are those of the paper (table of tasks in the appendix); the numbers are not in the paper.
    Departures: touch is limited to the hands and the eyes look at the object, which the paper says
    of GrabObject only; the distance is horizontal, and clipped at `clip_m`, so that a toy that is
    pushed across the room costs no more than one out of reach.

    The body is free and can topple. An episode lasts `max_seconds` and never terminates. The task
    is solved (`solved`) while the toy is within `solved_m` of the mark.

    Terms:
        progress: Decrease during the step of the horizontal distance between toy and mark, m,
            where the distance is clipped to `clip_m`.
    """

    senses = ("vision", "touch", "proprioception")
    body_cfg = HumanoidCfg
    ages_months = None  # positions and sizes of things are for these arms and hands
    cfg: MoveToTargetCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        asked = (
            f"task.ahead_m={tuple(cfg.ahead_m)}, task.aside_m={cfg.aside_m:g}, "
            f"task.target_m={tuple(cfg.target_m)}"
        )
        aside_m = cfg.aside_m + cfg.target_m[1]
        check_seat(cls.__name__, playground, cfg.ahead_m[1], aside_m, cfg.edge_m, asked)

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.toy = add_toy(self.world, self.cfg)
        self.mark = self.world.add_prop(
            PropCfg(
                name="mark",
                shape=PropShape.cylinder,
                size_m=[self.cfg.solved_m, _MARK_HEIGHT_M],
                colour=(0.1, 0.7, 0.2),
                tangible=False,
            )
        )
        self._clipped_m = self._progress_m = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        place_toy(self.toy, self.cfg, rng)
        offset = rng.choice((-1.0, 1.0)) * rng.uniform(*self.cfg.target_m)
        self.mark.place(horizontal(self.toy.position) + np.array([0.0, offset, _MARK_HEIGHT_M / 2]))
        self.child.look_toward_point(self.toy.position)
        self._clipped_m, self._progress_m = self.distance_m, 0.0

    def after_step(self, rng: np.random.Generator) -> None:
        self.child.look_toward_point(self.toy.position)
        clipped_m = min(self.distance_m, self.cfg.clip_m)
        self._progress_m = self._clipped_m - clipped_m
        self._clipped_m = clipped_m

    def reward(self, player: Player) -> dict[str, float]:
        return {"progress": self._progress_m}

    @property
    def distance_m(self) -> float:
        """Horizontal distance between the toy and the mark."""
        return float(np.linalg.norm(horizontal(self.toy.position - self.mark.position)))

    def solved(self, player: Player) -> bool:
        """Return whether the toy is at the mark."""
        return self.distance_m <= self.cfg.solved_m
