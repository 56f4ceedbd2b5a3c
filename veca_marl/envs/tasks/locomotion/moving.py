"""What the tasks of a child that learns to move share: how it starts, which way it faces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import TaskCfg
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import POSTURES, Posture
from veca_marl.sim.physics import RoomCfg

_FROM_WALLS_M = 1.0


@dataclass
class StartCfg(TaskCfg):
    """How exactly a child starts in a posture.

    Attributes:
        spread_deg: Standard deviation of every joint from the posture at the start; above 30
            degrees it would not resemble the posture any more.
    """

    spread_deg: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.spread_deg <= 30.0:
            raise ValueError(f"task.spread_deg={self.spread_deg} must be in [0, 30]")


def draw_posture(shares: dict[str, float], rng: np.random.Generator) -> Posture:
    """Return one of the `POSTURES`, as often as its share of the sum says."""
    names = [name for name, share in shares.items() if share > 0.0]
    if len(names) == 1:
        return POSTURES[names[0]]
    chances = np.array([shares[name] for name in names])
    return POSTURES[names[rng.choice(len(names), p=chances / chances.sum())]]


def start_anywhere(
    body: Humanoid, room: RoomCfg, posture: Posture, spread_deg: float, rng: np.random.Generator
) -> None:
    """Put a child anywhere in a room, facing anywhere, its joints a little off a posture."""
    place = room.sample_floor(rng, margin_m=_FROM_WALLS_M)
    varied = body.perturb(posture, spread_deg, rng)
    body.place(place, rng.uniform(-math.pi, math.pi), varied)


def start_near_edge(
    body: Humanoid, room: RoomCfg, posture: Posture, spread_deg: float, rng: np.random.Generator
) -> None:
    """Put a child near the edge of a room, the middle ahead, its joints a little off a posture."""
    place, heading = room.sample_start(rng, margin_m=_FROM_WALLS_M)
    body.place(place, heading, body.perturb(posture, spread_deg, rng))


def face_down(body: Humanoid) -> dict[str, float]:
    """Return the cosines between straight down and the fronts of chest and pelvis, in [-1, 1]."""
    return {
        "torso": -float(body.bone("chest").forward[2]),
        "hip": -float(body.bone("pelvis").forward[2]),
    }
