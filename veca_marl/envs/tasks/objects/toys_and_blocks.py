"""The blocks of PileUpBlock and PutDownBlock, and relations between them.

Piles need more iterations of Bullet's solver (`ClockCfg.solver_iterations`) than its default: see
the presets of both tasks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from veca_marl.envs.core.task import TaskCfg
from veca_marl.envs.tasks.objects.clearance import clearance_m
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.physics import Prop, PropCfg, PropShape, World

RED = (0.9, 0.12, 0.1)
BLUE = (0.15, 0.3, 0.9)
START_GAP_M = 0.002  # between stacked blocks: Bullet would restore contacts of the last episode
_REST_MPS = 0.05
_HAND_SPAN_M = 0.1


@dataclass
class BlocksCfg(TaskCfg):
    """Parameters of cubic blocks.

    Attributes:
        edge_m: Length of their edges, at most 0.1 m.
        mass_kg: Mass of one block.
        friction: Friction on the floor; between two blocks it applies squared.
    """

    edge_m: float = 0.06
    mass_kg: float = 0.06
    friction: float = 1.2

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("edge_m", "mass_kg", "friction")
        if self.edge_m > _HAND_SPAN_M:
            raise ValueError(
                f"task.edge_m={self.edge_m}: a child's hands span at most {_HAND_SPAN_M} m"
            )


def add_block(world: World, cfg: BlocksCfg, name: str, colour: tuple[float, float, float]) -> Prop:
    """Add a block to a world, without contact to any other until it is placed.

    Bullet does not restore contacts correctly from a state that was saved with objects in contact.
    """
    low, edge = world.playground.rooms[0].lower_m, cfg.edge_m
    aside = 0.3 + 2.0 * edge * len(world.props)
    position = (low[0] + aside, low[1] + 0.3, low[2] + edge / 2)
    return world.add_prop(
        PropCfg(
            name=name,
            shape=PropShape.box,
            size_m=[cfg.edge_m] * 3,
            position_m=position,
            mass_kg=cfg.mass_kg,
            friction=cfg.friction,
            restitution=0.0,
            colour=colour,
        )
    )


def height_in_edges(block: Prop) -> float:
    """Return the height of a block's lowest corner above the floor, in lengths of its edge."""
    return clearance_m(block) / block.cfg.size_m[0]


def rests_on(block: Prop, base: Prop) -> bool:
    """Return whether a block is at rest on top of another one, also if it lies on a third, too."""
    above = block.position[2] - base.position[2] > 0.9 * block.cfg.size_m[0]
    return bool(above) and block.touches(base.body_id) and is_at_rest(block)


def stands_free(block: Prop, others: Sequence[Prop], child: Humanoid) -> bool:
    """Return whether no part of a body touches a block, or one that is in contact with it.

    Contacts are followed from block to block: a block is carried by what is below it, or by
    friction between two that are pressed to its sides.

    Args:
        block: The block.
        others: Blocks that may carry it, and each other.
        child: The body.
    """
    group, rest = [block], [other for other in others if other is not block]
    for member in group:  # the list grows while it is read
        touched = [other for other in rest if member.touches(other.body_id)]
        group += touched
        rest = [other for other in rest if other not in touched]
    return all(is_released(member, child) for member in group)


def is_at_rest(block: Prop) -> bool:
    """Return whether the speed of a block is below 0.05 m/s."""
    return math.dist(block.velocity, (0.0, 0.0, 0.0)) < _REST_MPS


def is_released(block: Prop, child: Humanoid) -> bool:
    """Return whether no part of a body touches a block."""
    return not child.touches(block)
