"""TurnBaby: lie on the back, turn over to the belly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.moving import StartCfg, face_down, start_anywhere
from veca_marl.sim.body.humanoid.postures import ON_BACK


@dataclass
class TurnBabyCfg(StartCfg):
    """How the child lies at the start, and what lying on the belly is worth.

    Attributes:
        spread_deg: Standard deviation of every joint from the posture `on_back` at the start.
    """

    max_seconds: float = 8.0
    weights: dict[str, float] = terms(torso=0.025, hip=0.025)


@register
class TurnBaby(Task):
    """A child lies on its back, with its joints a little anywhere; it shall turn to its belly.

    The paper rewards "the orientation of its torso and hip" and says no more. Ours: the episode
    begins anywhere in the room, lasts 8 s and never ends early; with the default weights it is
    worth -10 to who stays on the back and +10 to who lay on the belly all the time.

    Terms:
        torso: cosine of the angle between the front of the chest and straight down, in [-1, 1].
        hip: the same of the pelvis.
    """

    senses = ("proprioception", "touch")
    cfg: TurnBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]

    def reset(self, rng: np.random.Generator) -> None:
        start_anywhere(self.body, self.room, ON_BACK, self.cfg.spread_deg, rng)

    def reward(self, player: Player) -> dict[str, float]:
        return face_down(self.body)
