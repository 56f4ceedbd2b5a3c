"""Building blocks: what the tasks with towers share."""

from __future__ import annotations

import math
from dataclasses import dataclass

from veca_marl.envs.core.task import TaskCfg
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.physics.props import Prop, PropCfg, PropShape
from veca_marl.sim.physics.world import World

RED = (0.9, 0.12, 0.1)
BLUE = (0.15, 0.3, 0.9)
_STILL_MPS = 0.05


@dataclass
class BlocksCfg(TaskCfg):
    """Blocks are cubes.

    Attributes:
        edge_m: Length of their edges.
        mass_kg: Mass of one.
        friction: Their friction on the floor; on each other it counts twice, as a factor.
    """

    edge_m: float = 0.06
    mass_kg: float = 0.06
    friction: float = 1.2

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("edge_m", "mass_kg", "friction")
        if self.edge_m > 0.1:
            raise ValueError(f"task.edge_m={self.edge_m}: a child's hands span at most 0.1 m")


def add_block(world: World, cfg: BlocksCfg, name: str, colour: tuple[float, float, float]) -> Prop:
    """Put a block into a world, apart from all others until it is placed."""
    # Bullet mixes up the contacts of saved states in which things meet
    low, edge = world.playground.rooms[0].lower_m, cfg.edge_m
    aside = 0.3 + 2.0 * edge * len(world.props)
    place = (low[0] + aside, low[1] + 0.3, low[2] + edge / 2)
    return world.add_prop(
        PropCfg(
            name=name,
            shape=PropShape.box,
            size_m=[cfg.edge_m] * 3,
            position_m=place,
            mass_kg=cfg.mass_kg,
            friction=cfg.friction,
            restitution=0.0,
            colour=colour,
        )
    )


def height(block: Prop) -> float:
    """Return how high a block is above its place on the floor, in its own edges."""
    edge = block.cfg.size_m[0]
    return float(block.position[2]) / edge - 0.5


def rests_on(block: Prop, other: Prop) -> bool:
    """Say whether a block lies still on top of another."""
    way, edge = block.position - other.position, block.cfg.size_m[0]
    on_top = way[2] > 0.9 * edge and math.hypot(way[0], way[1]) < 0.75 * edge
    return bool(on_top) and block.touches(other.body_id) and is_still(block)


def is_still(block: Prop) -> bool:
    """Say whether a block lies still."""
    return math.dist(block.velocity, (0.0, 0.0, 0.0)) < _STILL_MPS


def is_free(block: Prop, child: Humanoid) -> bool:
    """Say whether no part of a child touches a block."""
    return not child.touches(block)
