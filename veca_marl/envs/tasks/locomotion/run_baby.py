"""RunBaby: run forwards on two feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.scoring import clipped_speed_mps, horizontal
from veca_marl.envs.core.task import Player, Task, register, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.start_poses import StartCfg, start_near_edge
from veca_marl.sim.body.humanoid.postures import STANDING


@dataclass
class RunBabyCfg(StartCfg):
    """Parameters of RunBaby.

    Attributes:
        spread_deg: Standard deviation of every joint angle at the start about the posture
            `standing`, in [0, 30].
        top_mps: Speed at which the term `forward` is clipped.
        fallen_m: Height of the top of the chest (the base of the neck) below which the body has
            fallen, in [0, 0.5]; it is 0.61 m when standing. 0 turns the termination off.
    """

    max_seconds: float = 8.0
    spread_deg: float = 2.0
    top_mps: float = 2.0
    fallen_m: float = 0.35
    weights: dict[str, float] = terms(forward=0.1)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("top_mps")
        if not 0.0 <= self.fallen_m <= 0.5:
            raise ValueError(f"task.fallen_m={self.fallen_m} must be in [0, 0.5]")


@register
class RunBaby(Task):
    """A joint-level body stands at the edge of the room, faces its middle and has to run.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    velocity to the direction of its torso" and gives no numbers. In this task the velocity is
    that of the chest along the horizontal part of its forward axis, so that a body that dives or
    slides on its belly is rewarded little. A fall terminates the episode; otherwise it lasts
    `max_seconds`. With the default weight, 1 m adds 2.5 to the return.

    Terms:
        forward: Mean velocity of the chest during the step along the horizontal part of its
            forward axis, m/s, clipped to [-top_mps, top_mps].
    """

    senses = ("proprioception", "touch")
    cfg: RunBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        self.room = self.world.playground.rooms[0]
        self._position, self._displacement = np.zeros(3), np.zeros(3)

    def reset(self, rng: np.random.Generator) -> None:
        start_near_edge(self.body, self.room, STANDING, self.cfg.spread_deg, rng)
        self._position = self.body.bone("chest").position

    def after_step(self, rng: np.random.Generator) -> None:
        position = self.body.bone("chest").position
        self._displacement, self._position = position - self._position, position

    def reward(self, player: Player) -> dict[str, float]:
        step_s, top_mps = self.world.clock.step_s, self.cfg.top_mps
        ahead = horizontal(self.body.bone("chest").forward)
        return {"forward": clipped_speed_mps(self._displacement, ahead, step_s, top_mps)}

    def terminated(self) -> bool:
        return bool(self.body.bone("neck").position[2] < self.cfg.fallen_m)
