"""SitBaby: from lying on the back, come to sit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.experts.sit_up import SitUp
from veca_marl.envs.moving import StartCfg, start_anywhere
from veca_marl.envs.scoring import share
from veca_marl.envs.task import Player, Task, humanoid, register, terms
from veca_marl.sim.bodies.postures import ON_BACK


@dataclass
class SitBabyCfg(StartCfg):
    """How the child lies at the start, and how high who sits is.

    Attributes:
        spread_deg: Standard deviation of every joint from the posture `on_back` at the start.
        torso_m: Height of the top of the chest (where the neck begins) of who sits upright.
        head_m: Height of the middle of the head of who sits upright.
    """

    max_seconds: float = 10.0
    torso_m: float = 0.31
    head_m: float = 0.40
    weights: dict[str, float] = terms(torso=0.02, head=0.02)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive("torso_m", "head_m")


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
        self.body = humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]
        self._expert = SitUp(self.body, self.world.clock.step_s)

    def reset(self, rng: np.random.Generator) -> None:
        start_anywhere(self.body, self.room, ON_BACK, self.cfg.spread_deg, rng)
        self._expert.reset()

    def reward(self, player: Player) -> dict[str, float]:
        return {
            "torso": share(self.body.bone("neck").position[2], self.cfg.torso_m),
            "head": share(self.body.mount("head").position[2], self.cfg.head_m),
        }

    def expert(self, player: Player, observation: dict[str, NDArray[Any]]) -> Any:
        """Turn to the belly, push up on the hands, sit on the heels. Uses the true trunk pose."""
        return self._expert.wish()
