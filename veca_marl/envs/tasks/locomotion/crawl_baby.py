"""CrawlBaby: crawl forwards on hands and knees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import clipped_speed_mps
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.start_poses import (
    StartCfg,
    face_down_cosines,
    start_near_edge,
)
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS


@dataclass
class CrawlBabyCfg(StartCfg):
    """Parameters of CrawlBaby.

    Attributes:
        spread_deg: Standard deviation of every joint angle at the start about the posture
            `on_all_fours`, in [0, 30].
        top_mps: Speed at which the term `forward` is clipped.
    """

    max_seconds: float = 8.0
    spread_deg: float = 2.0
    top_mps: float = 1.0
    weights: dict[str, float] = terms(forward=0.1, torso=0.005, hip=0.005)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("top_mps")


@register
class CrawlBaby(Task):
    """A joint-level body on hands and knees has to crawl from the edge of the room to its middle.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    velocity and the orientation of its torso and hip" and gives no numbers. In this task the
    velocity is that of the pelvis along the heading of the trunk, and the rewarded orientation is
    face down. The orientation has a small weight, since it is right at the start. An episode
    lasts `max_seconds` and never terminates. With the default weights, 1 m adds 2.5 to the return.

    Terms:
        forward: Mean velocity of the pelvis during the step along the horizontal heading of the
            trunk, m/s, clipped to [-top_mps, top_mps].
        torso: Cosine of the angle between the front of the chest and straight down, in [-1, 1].
        hip: The same for the pelvis.
    """

    senses = ("proprioception", "touch")
    cfg: CrawlBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]
        self._position, self._displacement = np.zeros(3), np.zeros(3)

    def reset(self, rng: np.random.Generator) -> None:
        start_near_edge(self.body, self.room, ON_ALL_FOURS, self.cfg.spread_deg, rng)
        self._position = self.body.position

    def after_step(self, rng: np.random.Generator) -> None:
        position = self.body.position
        self._displacement, self._position = position - self._position, position

    def reward(self, player: Player) -> dict[str, float]:
        step_s, top_mps = self.world.clock.step_s, self.cfg.top_mps
        speed_mps = clipped_speed_mps(self._displacement, self.body.forward, step_s, top_mps)
        return {"forward": speed_mps, **face_down_cosines(self.body)}
