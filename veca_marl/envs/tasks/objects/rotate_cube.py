"""RotateCube: turn the cube that lies on the palm."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import rotation_angle_rad
from veca_marl.envs.core.task import Player, Task, TaskCfg, register, require_humanoid, terms
from veca_marl.sim.body.humanoid.postures import OFFERING
from veca_marl.sim.geometry.rotations import rotation_about_vertical
from veca_marl.sim.physics.props import PropCfg, PropShape

_GAP_M = 0.001  # between the cube and the skin of the palm at the start
SHOULDER = "r_upper_arm.abduction"


@dataclass
class RotateCubeCfg(TaskCfg):
    """The cube, and how it is to be turned.

    Attributes:
        edge_m: Length of the cube's edges.
        mass_kg: Its mass.
        friction: Its friction, see `PropCfg`.
        turn_deg: The target: so far about the vertical from the start, positive to the left.
        start_deg: At the start the cube is turned on the palm by so much at most.
        lost_m: A cube whose centre is so far from the middle of the palm has fallen off the hand.
        there_deg: The task is solved while the cube is within so much of its target.
    """

    max_seconds: float = 8.0
    edge_m: float = 0.04
    mass_kg: float = 0.03
    friction: float = 1.2
    turn_deg: float = 45.0
    start_deg: float = 10.0
    lost_m: float = 0.08
    there_deg: float = 10.0
    weights: dict[str, float] = terms(progress=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("edge_m", "mass_kg", "friction")
        if not self.edge_m < self.lost_m < math.inf:
            raise ValueError(f"task.lost_m={self.lost_m} must be above task.edge_m={self.edge_m}")
        if not 0.0 <= self.start_deg <= 45.0:
            raise ValueError(f"task.start_deg={self.start_deg} must be in [0, 45]")
        if not 0.0 < self.there_deg < abs(self.turn_deg) <= 180.0:
            raise ValueError(
                f"task.turn_deg={self.turn_deg} must be farther than "
                f"task.there_deg={self.there_deg} and at most half a turn"
            )


@register
class RotateCube(Task):
    """A child lies on its back with a cube on its right palm: turn the cube to the left.

    The back of the hand lies on the floor. The paper gives the senses (no eyes), the joint-level
    action and the reward, the decrease of the distance between the cube's orientation and the
    target's; the rest is ours. No sense tells the target, so it is the same in every episode: 45
    degrees about the vertical from the start, in the world's frame. Fingers may turn the cube on
    the hand, or the wrist and the arm the hand with the cube. An episode lasts 8 s and never ends
    early. It is solved (`solved`) while the cube is on the hand and within 10 degrees of the
    target.

    Terms:
        progress: by how much the angle between the cube and its target became less in this step,
            in radians. While the cube is off the hand the angle counts as it was at the start: all
            that was won is lost, and how the cube rolls away is worth nothing.
    """

    senses = ("touch", "proprioception")
    cfg: RotateCubeCfg

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
        turned = math.radians(rng.uniform(-self.cfg.start_deg, self.cfg.start_deg))
        hand_rad = math.radians(-OFFERING.joints_deg[SHOULDER])
        self.cube.place(self.child.palms()[1] + above, hand_rad + turned)
        turn = rotation_about_vertical(math.radians(self.cfg.turn_deg))
        self.target = turn @ self.cube.rotation
        self._angle_rad = self._start_rad = self.angle_rad
        self._progress_rad = 0.0

    def after_step(self, rng: np.random.Generator) -> None:
        angle_rad = self.angle_rad if self.on_hand else self._start_rad
        self._progress_rad, self._angle_rad = self._angle_rad - angle_rad, angle_rad

    def reward(self, player: Player) -> dict[str, float]:
        return {"progress": self._progress_rad}

    @property
    def angle_rad(self) -> float:
        """The angle between the cube and its target."""
        return rotation_angle_rad(self.cube.rotation, self.target)

    @property
    def on_hand(self) -> bool:
        """Whether the cube is still on the right hand."""
        return math.dist(self.cube.position, self.child.palms()[1]) < self.cfg.lost_m

    @property
    def solved(self) -> bool:
        """Whether the cube on the hand is turned as it should be."""
        return self.on_hand and self.angle_rad <= math.radians(self.cfg.there_deg)
