"""TurnBaby: turn over from the back to the belly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, register_task, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.motor_skills import (
    PosedStart,
    StartCfg,
    face_down_cosines,
    start_anywhere,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK


@dataclass
class TurnBabyCfg(StartCfg):
    """Parameters of TurnBaby.

    Attributes:
        spread_deg: Standard deviation of every joint angle at the start about the posture
            `on_back`, in [0, 30].
        turned_deg: Angle from straight down up to which the fronts of chest and pelvis count as
            turned over.
    """

    max_seconds: float = 8.0
    turned_deg: float = 45.0
    weights: dict[str, float] = terms(torso=0.025, hip=0.025)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.turned_deg < 90.0:
            raise ValueError(f"task.turned_deg={self.turned_deg} must be between 0 and 90")


@register_task
class TurnBaby(PosedStart):
    """A joint-level body lies on its back at a random position in the room and has to turn over.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    orientation of its torso and hip" and gives no numbers. This task rewards a front that points
    straight down. An episode lasts `max_seconds` and never terminates. With the default weights
    its return is -10 on the back and +10 on the belly. A body that sits and folds forwards, chest
    on the legs, is rewarded by four fifths of that: the front of its pelvis points about 55 degrees
    away from straight down. The task is solved (`solved`) while the fronts of chest and pelvis
    point at most `turned_deg` away from it.

    Terms:
        torso: Cosine of the angle between the front of the chest and straight down, in [-1, 1].
        hip: The same for the pelvis.
    """

    senses = ("proprioception", "touch")
    rates = ("torso", "hip")
    body_cfg = HumanoidCfg
    cfg: TurnBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])

    def reset(self, rng: np.random.Generator) -> None:
        start_anywhere(self.world, self.body, ON_BACK, self.cfg.spread_deg, rng)

    def reward(self, player: Player) -> dict[str, float]:
        return face_down_cosines(self.body)

    def solved(self, player: Player) -> bool:
        """Return whether the front of the body points down."""
        least = math.cos(math.radians(self.cfg.turned_deg))
        return min(face_down_cosines(self.body).values()) >= least
