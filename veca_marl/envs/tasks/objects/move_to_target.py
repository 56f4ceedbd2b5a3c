"""MoveToTarget: bring the toy to the mark on the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import horizontal
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.objects.grasping import ToyCfg, add_toy, lay_down
from veca_marl.sim.body.humanoid.postures import REACHING
from veca_marl.sim.physics.props import PropCfg, PropShape

_THIN_M = 0.001


@dataclass
class MoveToTargetCfg(ToyCfg):
    """Where the mark is.

    Attributes:
        way_m: Least and greatest distance of the mark from the toy, to the left or the right.
        far_m: A toy farther from the mark than this counts as so far away.
        there_m: The task is solved while the toy's centre is so close to the mark.
    """

    max_seconds: float = 10.0
    aside_m: float = 0.0
    way_m: tuple[float, float] = (0.08, 0.12)
    far_m: float = 0.15
    there_m: float = 0.05
    weights: dict[str, float] = terms(progress=10.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        near, far = self.way_m
        if not 0.0 < self.there_m < near <= far < math.inf:
            raise ValueError(
                f"task.way_m={(near, far)} must be (least, greatest), above "
                f"task.there_m={self.there_m}"
            )
        if not far <= self.far_m < math.inf:
            raise ValueError(f"task.far_m={self.far_m} must be at least task.way_m={(near, far)}")


@register
class MoveToTarget(Task):
    """A child sits on the floor with a toy before it: bring it to the green mark.

    The mark is a disc on the floor that is seen and not felt. The paper gives the senses (as in
    GrabObject: only the hands feel, the eyes look at the object), the joint-level action and the
    reward; the numbers are ours. The child is free: it may topple. An episode lasts 10 s and never
    ends early. It is solved (`solved`) while the toy is within 5 cm of the mark.

    Terms:
        progress: how much nearer to the mark the toy came in this step, in metres along the floor.
            Farther away than 0.15 m nothing changes: a toy kicked across the room is no worse than
            one that is out of reach.
    """

    senses = ("vision", "touch", "proprioception")
    cfg: MoveToTargetCfg

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.toy = add_toy(self.world, self.cfg)
        self.mark = self.world.add_prop(
            PropCfg(
                name="mark",
                shape=PropShape.cylinder,
                size_m=[self.cfg.there_m, _THIN_M],
                colour=(0.1, 0.7, 0.2),
                tangible=False,
            )
        )
        self._counted_m = self._progress_m = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        lay_down(self.toy, self.cfg, rng)
        way = rng.choice((-1.0, 1.0)) * rng.uniform(*self.cfg.way_m)
        self.mark.place(horizontal(self.toy.position) + np.array([0.0, way, _THIN_M / 2]))
        self.child.look_toward_point(self.toy.position)
        self._counted_m, self._progress_m = self.distance_m, 0.0

    def after_step(self, rng: np.random.Generator) -> None:
        self.child.look_toward_point(self.toy.position)
        counted_m = min(self.distance_m, self.cfg.far_m)
        self._progress_m = self._counted_m - counted_m
        self._counted_m = counted_m

    def reward(self, player: Player) -> dict[str, float]:
        return {"progress": self._progress_m}

    @property
    def distance_m(self) -> float:
        """How far the toy is from the mark, along the floor."""
        return float(np.linalg.norm(horizontal(self.toy.position - self.mark.position)))

    @property
    def solved(self) -> bool:
        """Whether the toy is on the mark."""
        return self.distance_m <= self.cfg.there_m
