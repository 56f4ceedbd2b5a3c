"""A toy before a sitting child: what the tasks of grasping share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import TaskCfg
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.physics.props import Prop, PropCfg, PropShape
from veca_marl.sim.physics.world import World

_WIDEST_M = 0.1  # between the palms of a sitting child


@dataclass
class ToyCfg(TaskCfg):
    """A cube on the floor before the child, whose pelvis is at the origin and faces x.

    Attributes:
        edge_m: Length of its edges.
        mass_kg: Its mass.
        friction: Its friction, see `PropCfg`.
        ahead_m: Least and greatest distance ahead of the child at the start.
        aside_m: It starts at most so far to the left or right.
        turn_deg: It is turned by so much at most.
        near_m: A hand is near while its palm is so close to the toy's surface.
    """

    edge_m: float = 0.07
    mass_kg: float = 0.1
    friction: float = 1.2
    ahead_m: tuple[float, float] = (0.24, 0.27)
    aside_m: float = 0.02
    turn_deg: float = 10.0
    near_m: float = 0.04

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("edge_m", "mass_kg", "friction", "near_m")
        if self.edge_m > _WIDEST_M:
            raise ValueError(f"task.edge_m={self.edge_m}: hands span at most {_WIDEST_M} m")
        near, far = self.ahead_m
        if not self.edge_m < near <= far < math.inf:
            raise ValueError(
                f"task.ahead_m={(near, far)} must be (least, greatest), above task.edge_m"
            )
        if not 0.0 <= self.aside_m < math.inf:
            raise ValueError(f"task.aside_m={self.aside_m} must be 0 or more")


def add_toy(world: World, cfg: ToyCfg) -> Prop:
    """Put the toy into a world."""
    return world.add_prop(
        PropCfg(
            name="toy",
            shape=PropShape.box,
            size_m=[cfg.edge_m] * 3,
            mass_kg=cfg.mass_kg,
            friction=cfg.friction,
            restitution=0.0,
            colour=(0.9, 0.12, 0.1),
        )
    )


def lay_down(toy: Prop, cfg: ToyCfg, rng: np.random.Generator) -> None:
    """Put the toy on a random place of the floor before the child."""
    ahead, aside = rng.uniform(*cfg.ahead_m), rng.uniform(-cfg.aside_m, cfg.aside_m)
    turn = math.radians(rng.uniform(-cfg.turn_deg, cfg.turn_deg))
    toy.place((ahead, aside, cfg.edge_m / 2), turn)


def hand_distances(child: Humanoid, toy: Prop) -> Floats:
    """Return how far the middles of the palms are from the toy's centre, ``(2,)`` metres."""
    distances: Floats = np.linalg.norm(child.palms() - toy.position, axis=1)
    return distances


def in_both_hands(child: Humanoid, toy: Prop, cfg: ToyCfg) -> bool:
    """Say whether both palms are near a toy; its surface is taken as half an edge away."""
    return bool((hand_distances(child, toy) <= cfg.edge_m / 2 + cfg.near_m).all())
