"""What the tasks with objects share: the toy, the blocks, and the check of the seat.

Piles need more iterations of Bullet's solver (`ClockCfg.solver_iterations`) than its default: see
the presets of PileUpBlock and PutDownBlock.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import TaskCfg
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World


def clearance_m(box: Prop) -> float:
    """Return the height of the lowest corner of a box above the floor at z = 0, metres.

    A box that is tipped on the floor has no clearance, although its centre rises.
    """
    half_height = 0.5 * float(np.abs(box.rotation[2]) @ np.asarray(box.cfg.size_m))
    return float(box.position[2]) - half_height


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


_AHEAD_M = 0.6  # outstretched legs, or the head of a body that lies on its back
_ASIDE_M = 0.45  # elbows


def check_seat(
    task: str,
    playground: PlaygroundCfg,
    ahead_m: float = 0.0,
    aside_m: float = 0.0,
    edge_m: float = 0.0,
    asked: str = "",
) -> None:
    """Check that a room has space for a body at the origin that faces +x, and for cubes.

    Args:
        task: Name of the task.
        playground: The playground.
        ahead_m: Greatest distance of the centre of a cube in front of the pelvis.
        aside_m: Greatest lateral distance of it.
        edge_m: Length of its edges; it may be turned.
        asked: The values of the task that place cubes, for the message.

    Raises:
        ValueError: If no room contains all of them.
    """
    corner_m = edge_m * math.sqrt(0.5)
    far, wide = max(ahead_m + corner_m, _AHEAD_M), max(aside_m + corner_m, _ASIDE_M)
    needed = list(itertools.product((-_AHEAD_M, far), (-wide, wide)))
    homes = [room for room in playground.rooms if room.distance_m((0.0, 0.0)) == 0.0]
    if any(all(room.distance_m(point) == 0.0 for point in needed) for room in homes):
        return
    rooms = " and ".join(f"room {room.name!r} of {room.extent}" for room in homes) or "no room"
    raise ValueError(
        f"{task} needs {far:.3g} m in front of the origin and {wide:.3g} m to its sides"
        f"{f' ({asked})' if asked else ''}; at the origin, playground {playground.name!r} has "
        f"{rooms}; choose {'smaller values or ' if asked else ''}playground=simple"
    )
