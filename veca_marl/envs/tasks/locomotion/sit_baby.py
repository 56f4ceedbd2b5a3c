"""SitBaby: from lying on the back, come to sit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import clipped_share
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.moving import StartCfg, draw_posture, start_anywhere


@dataclass
class SitBabyCfg(StartCfg):
    """How the child lies at the start, and how high who sits is.

    Attributes:
        starts: Shares of the postures in which episodes begin. Who learns may begin further on in
            part of them (a curriculum, see experiments/sitting).
        spread_deg: Standard deviation of every joint from the posture at the start.
        torso_m: Height of the top of the chest (where the neck begins) of who sits upright.
        head_m: Height of the middle of the head of who sits upright.
    """

    max_seconds: float = 10.0
    torso_m: float = 0.31
    head_m: float = 0.40
    starts: dict[str, float] = terms(on_back=1.0, on_belly=0.0, on_all_fours=0.0, sitting=0.0)
    weights: dict[str, float] = terms(torso=0.02, head=0.02)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("torso_m", "head_m")
        shares = self.starts.values()
        if not all(0.0 <= share < math.inf for share in shares) or sum(shares) == 0.0:
            raise ValueError(f"task.starts={self.starts} must be shares: 0 or more, not all 0")


@register
class SitBaby(Task):
    """A child lies on its back, with its joints a little anywhere; it shall come to sit.

    The paper rewards "the position of its torso and head" and says no more. Ours: what counts is
    how high they are, as a share of the height of a child that sits upright and no higher, so
    that to stand up is no better than to sit. How it sits is its own affair: on its bottom, on its
    heels, leaning on its hands. The torso is measured at its top: measured at the waist, a bridge
    on neck and feet would pay. The episode begins anywhere in the room, lasts 10 s and never ends
    early; with the default weights it is worth 10 to who sat all the time, and about 2 to who
    stays on the back.

    Terms:
        torso: height of the top of the chest above the floor, as a share of `torso_m`, in [0, 1].
        head: the same of the middle of the head and `head_m`.
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
