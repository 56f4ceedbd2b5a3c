"""GrabObject: lift a toy with both hands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Player, Task, register_task, require_humanoid, terms
from veca_marl.envs.tasks.objects.toys_and_blocks import (
    ToyCfg,
    add_toy,
    both_hands_near,
    check_seat,
    clearance_m,
    palm_distances_m,
    place_toy,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import REACHING
from veca_marl.sim.physics import PlaygroundCfg


@dataclass
class GrabObjectCfg(ToyCfg):
    """Parameters of GrabObject.

    Attributes:
        lifted_m: Clearance above the floor at which the task is solved while both hands are near.
    """

    max_seconds: float = 6.0
    lifted_m: float = 0.05
    weights: dict[str, float] = terms(lift=100.0, approach=1.0, effort=-0.004)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.lifted_m < math.inf:
            raise ValueError(f"task.lifted_m={self.lifted_m} must be a positive length")


@register_task
class GrabObject(Task):
    """A joint-level body sits on the floor in front of a toy and has to lift it with both hands.

    From the paper (table of tasks, "Perception/Action" and "Helper Rewards" in the appendix):
    touch is limited to the hands, the eyes look at the object, the reward is the vertical
    displacement "when the object is close enough to each hand", with helper rewards for approach
    and effort at weights of 1 and 0.004. Departures from the paper: the displacement is that of the
    toy's lowest corner, so that tipping the toy on the floor is not rewarded; when a hand leaves
    the toy, the height that was rewarded is subtracted again, so that dropping and lifting the toy
    repeatedly adds nothing. The weight of `lift` and the other numbers are not in the paper.

    The body is free and can topple. An episode lasts `max_seconds` and never terminates. The task
    is solved (`solved`) while both hands are near the toy and its lowest corner is `lifted_m` above
    the floor.

    Terms:
        lift: Increase during the step of the height of the toy's lowest corner above the floor, m,
            where the height counts as 0 unless both hands are near.
        approach: Decrease during the step of the sum of the distances of both palms from the
            centre of the toy, m.
        effort: Sum of the squared torques of all 82 joints, each as a fraction of its strength.
    """

    senses = ("vision", "touch", "proprioception")
    rates = ("effort",)
    body_cfg = HumanoidCfg
    ages_months = None  # positions and sizes of things are for these arms and hands
    cfg: GrabObjectCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        asked = f"task.ahead_m={tuple(cfg.ahead_m)}, task.aside_m={cfg.aside_m:g}"
        check_seat(cls.__name__, playground, cfg.ahead_m[1], cfg.aside_m, cfg.edge_m, asked)

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.toy = add_toy(self.world, self.cfg)
        self._held_m = self._lifted_m = self._distance_m = self._approached_m = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        place_toy(self.toy, self.cfg, rng)
        self.child.look_toward_point(self.toy.position)
        self._held_m, self._distance_m = self.held_m, self._palm_distance_m()

    def after_step(self, rng: np.random.Generator) -> None:
        self.child.look_toward_point(self.toy.position)
        held_m, distance_m = self.held_m, self._palm_distance_m()
        self._lifted_m, self._approached_m = held_m - self._held_m, self._distance_m - distance_m
        self._held_m, self._distance_m = held_m, distance_m

    def reward(self, player: Player) -> dict[str, float]:
        torques = self.child.joint_torques()
        return {
            "lift": self._lifted_m,
            "approach": self._approached_m,
            "effort": float(torques @ torques),
        }

    @property
    def held_m(self) -> float:
        """Height of the toy's lowest corner above the floor; 0 unless both hands are near."""
        if not both_hands_near(self.child, self.toy, self.cfg):
            return 0.0
        return clearance_m(self.toy)

    def solved(self, player: Player) -> bool:
        """Return whether the toy is lifted with both hands."""
        return self.held_m >= self.cfg.lifted_m

    def _palm_distance_m(self) -> float:
        return float(palm_distances_m(self.child, self.toy).sum())
