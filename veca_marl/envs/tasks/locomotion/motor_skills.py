"""What the tasks of motor skills share: starting poses, and the forward speed of a body."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Task, TaskCfg, horizontal
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import POSTURES, Posture
from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import PlaygroundCfg, World

_WALL_CLEARANCE_M = 1.0
_GREATEST_OVERLAP_M = 0.005  # the skin of hands and feet yields as much
_MOST_DRAWS = 200


@dataclass
class StartCfg(TaskCfg):
    """Parameters of a start in a posture.

    Attributes:
        spread_deg: Standard deviation of every joint angle about the posture, in [0, 30].
    """

    spread_deg: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.spread_deg <= 30.0:
            raise ValueError(f"task.spread_deg={self.spread_deg} must be in [0, 30]")


class PosedStart(Task):
    """A task in which a body starts in a posture on the floor of the first room."""

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        room, least_m = playground.rooms[0], 2.0 * _WALL_CLEARANCE_M
        if min(room.size_m[:2]) < least_m:
            raise ValueError(
                f"{cls.__name__} needs {least_m:g} m along x and y, to start {_WALL_CLEARANCE_M:g} "
                f"m away from walls; playground {playground.name!r} has room {room.name!r} of "
                f"{room.extent}; choose a larger room, or playground=simple"
            )


def draw_posture(weights: dict[str, float], rng: np.random.Generator) -> Posture:
    """Draw one of the `POSTURES` with a probability proportional to its weight."""
    names = [name for name, weight in weights.items() if weight > 0.0]
    if len(names) == 1:
        return POSTURES[names[0]]
    values = np.array([weights[name] for name in names])
    return POSTURES[names[rng.choice(len(names), p=values / values.sum())]]


def start_anywhere(
    world: World, body: Humanoid, posture: Posture, spread_deg: float, rng: np.random.Generator
) -> None:
    """Place a body in a posture with noise, anywhere in the first room with a random heading.

    Noise is drawn again while limbs penetrate each other, everything while furniture is touched.

    Raises:
        ValueError: If one of them is so in each of `_MOST_DRAWS` draws.
    """
    for _ in range(_MOST_DRAWS):
        position = world.playground.rooms[0].sample_floor(rng, margin_m=_WALL_CLEARANCE_M)
        noisy = body.perturb(posture, spread_deg, rng)
        heading_rad = rng.uniform(-math.pi, math.pi)
        body.place(position, heading_rad, noisy)
        _separate_limbs(world, body, position, heading_rad, posture, spread_deg, rng)
        if not world.touches_props(body.body_id):
            return
    raise ValueError(_no_place(world))


def start_near_edge(
    world: World, body: Humanoid, posture: Posture, spread_deg: float, rng: np.random.Generator
) -> None:
    """Place a body in a posture with noise, near the edge of the first room, facing its middle.

    Noise is drawn again while limbs penetrate each other, everything while furniture is touched.

    Raises:
        ValueError: If one of them is so in each of `_MOST_DRAWS` draws.
    """
    for _ in range(_MOST_DRAWS):
        room = world.playground.rooms[0]
        position, heading_rad = room.sample_start(rng, margin_m=_WALL_CLEARANCE_M)
        body.place(position, heading_rad, body.perturb(posture, spread_deg, rng))
        _separate_limbs(world, body, position, heading_rad, posture, spread_deg, rng)
        if not world.touches_props(body.body_id):
            return
    raise ValueError(_no_place(world))


def _no_place(world: World) -> str:
    return (
        f"playground {world.playground.name!r}: no place for the body on the floor of room "
        f"{world.playground.rooms[0].name!r} in {_MOST_DRAWS} draws; choose playground=simple"
    )


def _separate_limbs(
    world: World,
    body: Humanoid,
    position: Floats,
    heading_rad: float,
    posture: Posture,
    spread_deg: float,
    rng: np.random.Generator,
) -> None:
    """Draw the noise of a posture again while limbs of a body penetrate each other.

    Raises:
        ValueError: If they still do after `_MOST_DRAWS`.
    """
    for _ in range(_MOST_DRAWS):
        if world.overlap_m(body.body_id, body.body_id) <= _GREATEST_OVERLAP_M:
            return
        body.place(position, heading_rad, body.perturb(posture, spread_deg, rng))
    raise ValueError(
        f"task.spread_deg={spread_deg}: limbs of {body.name} overlap in each of {_MOST_DRAWS} "
        "starts; choose a smaller one"
    )


def face_down_cosines(body: Humanoid) -> dict[str, float]:
    """Return the cosines of the angles between straight down and the fronts of chest and pelvis.

    Returns:
        The reward terms ``torso`` and ``hip``, each in [-1, 1].
    """
    return {
        "torso": -float(body.bone("chest").forward[2]),
        "hip": -float(body.bone("pelvis").forward[2]),
    }


class ForwardProgress:
    """Mean forward speed of a part of a body during a step, from its displacement.

    The speed is the smaller one of two: along the direction that the body faces now, and along the
    direction that it faced at the start of the episode. The sum over a motion that returns to where
    it began is therefore at most 0, however the body turns, tilts and times it.

    Args:
        step_s: Duration of an environment step.
        top_mps: Upper limit of the speed. There is no lower limit, since a fast motion backwards
            would cost less than the slow one forwards brought.
    """

    def __init__(self, step_s: float, top_mps: float) -> None:
        self._step_s, self._top_mps = step_s, top_mps

    def reset(self, position: Floats, forward: Floats) -> None:
        """Begin an episode at a position ``(3,)`` m, facing a horizontal unit vector ``(3,)``."""
        self._position, self._start_forward = position, forward
        self.speed_mps = 0.0

    def update(self, position: Floats, forward: Floats) -> None:
        """Set `speed_mps` after a step.

        Args:
            position: ``(3,)`` metres.
            forward: ``(3,)``, the direction that the body faces; its vertical part is ignored, and
                a vector with a horizontal part shorter than 1 scales the speed.
        """
        displacement, self._position = horizontal(position - self._position), position
        along = min(float(displacement @ self._start_forward), float(displacement @ forward))
        self.speed_mps = min(along / self._step_s, self._top_mps)
