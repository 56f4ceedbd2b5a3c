"""CrawlBaby: on hands and knees, get ahead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import clipped_speed_mps
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.moving import StartCfg, start_near_edge
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS


@dataclass
class CrawlBabyCfg(StartCfg):
    """How the child starts, and what getting ahead is worth.

    Attributes:
        spread_deg: Standard deviation of every joint from the posture `on_all_fours` at the start.
        top_mps: To be faster is no better.
    """

    max_seconds: float = 8.0
    spread_deg: float = 2.0
    top_mps: float = 1.0
    weights: dict[str, float] = terms(forward=0.1, torso=0.005, hip=0.005)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("top_mps")


@register
class CrawlBaby(Task):
    """A child is on hands and knees near the edge of the room, the middle ahead; it shall crawl.

    The paper rewards "the velocity and the orientation of the torso and hip" and says no more.
    Ours: velocity is that of the pelvis along the trunk's heading, and face down is the right
    orientation. Orientation is worth little beside velocity, since it is right at the start. The
    episode lasts 8 s and never ends early; 1 m of crawling is worth 2.5 with the default weights.

    Terms:
        forward: mean velocity of the pelvis in this step along the horizontal heading of the trunk,
            m/s, at most `top_mps` either way.
        torso: cosine of the angle between the front of the chest and straight down, in [-1, 1].
        hip: the same of the pelvis.
    """

    senses = ("proprioception", "touch")
    cfg: CrawlBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]
        self._place, self._way = np.zeros(3), np.zeros(3)

    def reset(self, rng: np.random.Generator) -> None:
        start_near_edge(self.body, self.room, ON_ALL_FOURS, self.cfg.spread_deg, rng)
        self._place = self.body.position

    def after_step(self, rng: np.random.Generator) -> None:
        self._way = self.body.position - self._place
        self._place = self.body.position

    def reward(self, player: Player) -> dict[str, float]:
        step_s, top_mps = self.world.clock.step_s, self.cfg.top_mps
        return {
            "forward": clipped_speed_mps(self._way, self.body.forward, step_s, top_mps),
            "torso": -float(self.body.bone("chest").forward[2]),
            "hip": -float(self.body.bone("pelvis").forward[2]),
        }
