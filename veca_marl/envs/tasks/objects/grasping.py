"""The toy of GrabObject and MoveToTarget, and its distances to the hands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import TaskCfg
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import Prop, PropCfg, PropShape, World

_HAND_SPAN_M = 0.1


@dataclass
class ToyCfg(TaskCfg):
    """Parameters of a cube on the floor in front of a body at the origin that faces +x.

    Attributes:
        edge_m: Length of its edges, at most 0.1 m.
        mass_kg: Mass.
        friction: Friction, see `PropCfg`.
        ahead_m: Least and greatest distance in front of the pelvis at the start.
        aside_m: Largest lateral offset at the start.
        turn_deg: Largest yaw at the start.
        near_m: Distance between a palm and the surface up to which the hand counts as near.
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
        self.check_positive("edge_m", "mass_kg", "friction", "near_m")
        self.check_not_negative("aside_m", "turn_deg")
        if self.edge_m > _HAND_SPAN_M:
            raise ValueError(f"task.edge_m={self.edge_m}: hands span at most {_HAND_SPAN_M} m")
        near, far = self.ahead_m
        if not self.edge_m < near <= far < math.inf:
            raise ValueError(
                f"task.ahead_m={(near, far)} must be (least, greatest), above task.edge_m"
            )


def add_toy(world: World, cfg: ToyCfg) -> Prop:
    """Add the toy to a world."""
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


def place_toy(toy: Prop, cfg: ToyCfg, rng: np.random.Generator) -> None:
    """Place the toy at a random position and yaw on the floor in front of the body."""
    ahead, aside = rng.uniform(*cfg.ahead_m), rng.uniform(-cfg.aside_m, cfg.aside_m)
    yaw = math.radians(rng.uniform(-cfg.turn_deg, cfg.turn_deg))
    toy.place((ahead, aside, cfg.edge_m / 2), yaw)


def palm_distances_m(child: Humanoid, toy: Prop) -> Floats:
    """Return the distances of both palms from the centre of the toy, ``(2,)`` metres."""
    distances: Floats = np.linalg.norm(child.palms() - toy.position, axis=1)
    return distances


def both_hands_near(child: Humanoid, toy: Prop, cfg: ToyCfg) -> bool:
    """Return whether both palms are near the toy, taking its surface at half an edge."""
    return bool((palm_distances_m(child, toy) <= cfg.edge_m / 2 + cfg.near_m).all())
