"""SitBaby: sit up from lying on the back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import clipped_share
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.start_poses import StartCfg, draw_posture, start_anywhere


@dataclass
class SitBabyCfg(StartCfg):
    """Parameters of SitBaby.

    Attributes:
        starts: Weights of the postures in which episodes start, by name. Other postures than
            `on_back` make a curriculum, see experiments/sitting.
        spread_deg: Standard deviation of every joint angle at the start about the posture, in
            [0, 30].
        torso_m: Height of the top of the chest (the base of the neck) when sitting upright.
        head_m: Height of the middle of the head when sitting upright.
    """

    max_seconds: float = 10.0
    torso_m: float = 0.31
    head_m: float = 0.40
    starts: dict[str, float] = terms(on_back=1.0, on_belly=0.0, on_all_fours=0.0, sitting=0.0)
    weights: dict[str, float] = terms(torso=0.02, head=0.02)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("torso_m", "head_m")
        shares = self.starts.values()
        if not all(0.0 <= share < math.inf for share in shares) or sum(shares) == 0.0:
            raise ValueError(f"task.starts={self.starts} must be shares: 0 or more, not all 0")


@register
class SitBaby(Task):
    """A joint-level body lies on its back at a random place in the room and has to sit up.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    position of its torso and head" and gives no numbers. This task rewards their heights, as
    shares of the heights when sitting upright and clipped to 1, so that standing up brings no
    more than sitting. The torso is measured at its top, since a bridge on neck and feet raises
    the waist. Any way of sitting counts: on the bottom, on the heels, supported by the hands. An
    episode lasts `max_seconds` and never terminates. With the default weights its return is 10
    when sitting and about 2 when lying on the back.

    Terms:
        torso: Height of the top of the chest divided by `torso_m`, clipped to [0, 1].
        head: Height of the middle of the head divided by `head_m`, clipped to [0, 1].
    """

    senses = ("proprioception", "touch")
    cfg: SitBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]

    def reset(self, rng: np.random.Generator) -> None:
        posture = draw_posture(self.cfg.starts, rng)
        start_anywhere(self.body, self.room, posture, self.cfg.spread_deg, rng)

    def reward(self, player: Player) -> dict[str, float]:
        return {
            "torso": clipped_share(self.body.bone("neck").position[2], self.cfg.torso_m),
            "head": clipped_share(self.body.mount("head").position[2], self.cfg.head_m),
        }
