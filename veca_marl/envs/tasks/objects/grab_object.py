"""GrabObject: lift the toy with both hands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.objects.grasping import (
    ToyCfg,
    add_toy,
    hand_distances,
    in_both_hands,
    lay_down,
)
from veca_marl.sim.body.humanoid.postures import REACHING


@dataclass
class GrabObjectCfg(ToyCfg):
    """What lifting is, and what it is worth.

    Attributes:
        lifted_m: The task is solved while the toy is so much higher than at the start.
    """

    max_seconds: float = 6.0
    lifted_m: float = 0.05
    weights: dict[str, float] = terms(lift=100.0, approach=10.0, effort=-0.004)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.lifted_m < math.inf:
            raise ValueError(f"task.lifted_m={self.lifted_m} must be a positive length")


@register
class GrabObject(Task):
    """A child sits on the floor with a toy before it: lift it with both hands.

    The paper gives the senses (only the hands feel, the eyes always look at the object), the
    joint-level action, the reward for the vertical displacement "when the object is close enough
    to each hand", and both helper rewards. The numbers are ours, but for the weight of effort. So
    is that height counts as lost when a hand leaves the toy: else letting it fall and lifting it
    once more would pay for ever. The child is free: it may topple. An episode lasts 6 s and never
    ends early. It is solved (`solved`) while both hands hold the toy 5 cm up.

    Terms:
        lift: how much higher the toy came in this step, in metres, where the height of a toy that
            is not near both hands counts as 0.
        approach: d before the step less d after it, d the sum of the distances of both palms from
            the toy's centre, in metres.
        effort: sum of the squares of all 82 motors' torques, as shares of their strength.
    """

    senses = ("vision", "touch", "proprioception")
    cfg: GrabObjectCfg

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.toy = add_toy(self.world, self.cfg)
        self._held_m = self._lifted_m = self._distance_m = self._approached_m = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, REACHING)
        lay_down(self.toy, self.cfg, rng)
        self.child.look_toward_point(self.toy.position)
        self._held_m = self.held_m
        self._distance_m = self._distance()

    def after_step(self, rng: np.random.Generator) -> None:
        self.child.look_toward_point(self.toy.position)
        held_m, distance_m = self.held_m, self._distance()
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
        """How high both hands hold the toy above its place on the floor; 0 if they do not."""
        if not in_both_hands(self.child, self.toy, self.cfg):
            return 0.0
        return float(self.toy.position[2]) - self.cfg.edge_m / 2

    @property
    def solved(self) -> bool:
        """Whether both hands hold the toy up."""
        return self.held_m >= self.cfg.lifted_m

    def _distance(self) -> float:
        return float(hand_distances(self.child, self.toy).sum())
