"""RunBaby: from standing, get ahead on two feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import clipped_speed_mps, horizontal
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.moving import StartCfg, start_near_edge
from veca_marl.sim.body.humanoid.postures import STANDING


@dataclass
class RunBabyCfg(StartCfg):
    """How the child starts, what getting ahead is worth, and what a fall is.

    Attributes:
        spread_deg: Standard deviation of every joint from the posture `standing` at the start.
        top_mps: To be faster is no better.
        fallen_m: Who has the top of the chest (where the neck begins) lower than this has fallen.
            It is at 0.61 m in who stands.
    """

    max_seconds: float = 8.0
    spread_deg: float = 2.0
    top_mps: float = 2.0
    fallen_m: float = 0.35
    weights: dict[str, float] = terms(forward=0.1)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("top_mps")
        if not 0.0 <= self.fallen_m <= 0.5:
            raise ValueError(f"task.fallen_m={self.fallen_m} must be in [0, 0.5]")


@register
class RunBaby(Task):
    """A child stands near the edge of the room, the middle ahead; it shall run.

    The paper rewards "the velocity to the direction of its torso" and says no more. Ours: the
    velocity is that of the chest along the horizontal part of its forward axis, so that to dive
    headlong or to slide on the belly pays little. A fall ends the episode (`task.fallen_m=0` lets
    it go on); else it lasts 8 s. 1 m of running is worth 2.5 with the default weight.

    Terms:
        forward: mean velocity of the chest in this step along its forward axis as far as that is
            horizontal, m/s, at most `top_mps` either way.
    """

    senses = ("proprioception", "touch")
    cfg: RunBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]
        self._place, self._way = np.zeros(3), np.zeros(3)

    def reset(self, rng: np.random.Generator) -> None:
        start_near_edge(self.body, self.room, STANDING, self.cfg.spread_deg, rng)
        self._place = self.body.bone("chest").position

    def after_step(self, rng: np.random.Generator) -> None:
        place = self.body.bone("chest").position
        self._way, self._place = place - self._place, place

    def reward(self, player: Player) -> dict[str, float]:
        ahead = horizontal(self.body.bone("chest").forward)
        return {
            "forward": clipped_speed_mps(
                self._way, ahead, self.world.clock.step_s, self.cfg.top_mps
            )
        }

    def terminated(self) -> bool:
        return bool(self.body.bone("neck").position[2] < self.cfg.fallen_m)
