"""RotateCube: rotate a cube that lies on the palm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import (
    Player,
    Task,
    TaskCfg,
    register_task,
    require_humanoid,
    rotation_angle_rad,
    terms,
)
from veca_marl.envs.tasks.objects.toys_and_blocks import check_seat, clearance_m
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import OFFERING
from veca_marl.sim.geometry import rotation_about_vertical
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape

SHOULDER = "r_upper_arm.abduction"
_LARGEST_EDGE_M = 0.1
_GAP_M = 0.001  # between the cube and the skin of the palm at the start


@dataclass
class RotateCubeCfg(TaskCfg):
    """Parameters of RotateCube.

    Attributes:
        edge_m: Length of the cube's edges, at most 0.1 m: a palm is 0.04 m wide.
        mass_kg: Mass of the cube.
        friction: Friction of the cube, see `PropCfg`.
        turn_deg: Target orientation: yaw from the orientation at the start, positive to the left.
        start_deg: Largest yaw of the cube relative to the hand at the start, in [0, 45].
        lost_m: Distance of the cube's centre from the middle of the palm above which the cube has
            left the hand.
        clear_m: Height of the cube's lowest corner above the floor below which the cube has left
            the hand.
        solved_deg: Angle from the target up to which the task is solved.
    """

    max_seconds: float = 8.0
    edge_m: float = 0.04
    mass_kg: float = 0.03
    friction: float = 1.2
    turn_deg: float = 45.0
    start_deg: float = 10.0
    lost_m: float = 0.08
    clear_m: float = 0.005
    solved_deg: float = 10.0
    weights: dict[str, float] = terms(progress=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("edge_m", "mass_kg", "friction", "clear_m")
        if self.edge_m > _LARGEST_EDGE_M:
            raise ValueError(
                f"task.edge_m={self.edge_m} must be at most {_LARGEST_EDGE_M}: the cube lies on a "
                "palm"
            )
        if not self.edge_m < self.lost_m < math.inf:
            raise ValueError(f"task.lost_m={self.lost_m} must be above task.edge_m={self.edge_m}")
        if not 0.0 <= self.start_deg <= 45.0:
            raise ValueError(f"task.start_deg={self.start_deg} must be in [0, 45]")
        if not 0.0 < self.solved_deg < abs(self.turn_deg) <= 180.0:
            raise ValueError(
                f"task.turn_deg={self.turn_deg} must be farther than "
                f"task.solved_deg={self.solved_deg} and at most half a turn"
            )


@register_task
class RotateCube(Task):
    """A joint-level body lies on its back with a cube on its right palm and has to rotate the cube.

    The back of the hand lies on the floor. The senses (without vision), the joint-level action and
    the reward, "the difference in distance between the target orientation and the cube's
    orientation", are those of the paper (table of tasks in the appendix); the posture and all
    numbers are not in the paper, nor that the cube has to stay on the hand: the paper says "using
    its hand". No sense shows the target, so it is the same in every episode: a
    yaw of 45 degrees from the start, in the world frame. Fingers may rotate the cube on the hand,
    or wrist and arm may rotate the hand with the cube.

    An episode lasts `max_seconds` and never terminates. The task is solved (`solved`) while the
    cube is on the hand and within `solved_deg` of the target.

    Terms:
        progress: Decrease during the step of the angle between the cube and its target, rad. While
            the cube is off the hand (farther than `lost_m` from the palm, or on the floor) the
            angle counts as at the start, so that dropping the cube takes all progress back.
    """

    senses = ("touch", "proprioception")
    body_cfg = HumanoidCfg
    ages_months = None  # positions and sizes of things are for these arms and hands
    cfg: RotateCubeCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_seat(cls.__name__, playground)

    def build(self) -> None:
        self.child = require_humanoid(self.players[0])
        self.cube = self.world.add_prop(
            PropCfg(
                name="cube",
                shape=PropShape.box,
                size_m=[self.cfg.edge_m] * 3,
                mass_kg=self.cfg.mass_kg,
                friction=self.cfg.friction,
                restitution=0.0,
                colour=(0.9, 0.12, 0.1),
            )
        )
        self.target = np.eye(3)
        self._angle_rad = self._start_rad = self._progress_rad = 0.0

    def reset(self, rng: np.random.Generator) -> None:
        self.child.place((0.0, 0.0, 0.0), 0.0, OFFERING)
        above = np.array([0.0, 0.0, self.cfg.edge_m / 2 + _GAP_M])
        yaw_rad = math.radians(rng.uniform(-self.cfg.start_deg, self.cfg.start_deg))
        hand_rad = math.radians(-OFFERING.joints_deg[SHOULDER])
        self.cube.place(self.child.palms()[1] + above, hand_rad + yaw_rad)
        turn = rotation_about_vertical(math.radians(self.cfg.turn_deg))
        self.target = turn @ self.cube.rotation
        self._angle_rad = self._start_rad = self.angle_rad
        self._progress_rad = 0.0

    def after_step(self, rng: np.random.Generator) -> None:
        angle_rad = self.angle_rad if self.on_hand else self._start_rad
        self._progress_rad, self._angle_rad = self._angle_rad - angle_rad, angle_rad

    def reward(self, player: Player) -> dict[str, float]:
        return {"progress": self._progress_rad}

    def state(self) -> dict[str, float]:
        return {"angle_rad": self._angle_rad}

    @property
    def angle_rad(self) -> float:
        """Angle between the orientations of the cube and its target."""
        return rotation_angle_rad(self.cube.rotation, self.target)

    @property
    def on_hand(self) -> bool:
        """Whether the cube is near the right palm and above the floor."""
        near = math.dist(self.cube.position, self.child.palms()[1]) < self.cfg.lost_m
        return near and clearance_m(self.cube) > self.cfg.clear_m

    def solved(self, player: Player) -> bool:
        """Return whether the cube is on the hand and within `solved_deg` of the target."""
        return self.on_hand and self.angle_rad <= math.radians(self.cfg.solved_deg)
