"""CrawlBaby: crawl forwards on hands and knees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, register_task, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.motor_skills import (
    ForwardProgress,
    PosedStart,
    StartCfg,
    face_down_cosines,
    start_near_edge,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS


@dataclass
class CrawlBabyCfg(StartCfg):
    """Parameters of CrawlBaby.

    Attributes:
        spread_deg: Standard deviation of every joint angle at the start about the posture
            `on_all_fours`, in [0, 30].
        top_mps: Upper limit of the term `forward`.
    """

    max_seconds: float = 8.0
    spread_deg: float = 2.0
    top_mps: float = 1.0
    weights: dict[str, float] = terms(forward=0.1, torso=0.005, hip=0.005)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("top_mps")


@register_task
class CrawlBaby(PosedStart):
    """A joint-level body on hands and knees at the edge of the room has to crawl ahead.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    velocity and the orientation of its torso and hip" and gives no numbers. In this task the
    velocity is that of the pelvis along the heading of the trunk, and the rewarded orientation is
    face down. The orientation has a small weight, since it is right at the start. Departure: the
    velocity counts at most as much as its component along the heading at the start, so that rocking
    to and fro is not rewarded. An episode lasts `max_seconds` and never terminates. The task has no
    goal: the farther, the better. With the default weights, 1 m adds 2.5 to the return.

    Terms:
        forward: Mean speed of the pelvis during the step, m/s: the smaller one of its components
            along the horizontal heading of the trunk and along that at the start, at most
            `top_mps`.
        torso: Cosine of the angle between the front of the chest and straight down, in [-1, 1].
        hip: The same for the pelvis.
    """

    senses = ("proprioception", "touch")
    rates = ("forward", "torso", "hip")
    body_cfg = HumanoidCfg
    cfg: CrawlBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self._progress = ForwardProgress(self.world.clock.step_s, self.cfg.top_mps)

    def reset(self, rng: np.random.Generator) -> None:
        start_near_edge(self.world, self.body, ON_ALL_FOURS, self.cfg.spread_deg, rng)
        self._progress.reset(self.body.position, self.body.forward)

    def after_step(self, rng: np.random.Generator) -> None:
        self._progress.update(self.body.position, self.body.forward)

    def reward(self, player: Player) -> dict[str, float]:
        return {"forward": self._progress.speed_mps, **face_down_cosines(self.body)}
