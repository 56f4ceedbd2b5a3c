"""RunBaby: run forwards on two feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, horizontal, register_task, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.motor_skills import (
    ForwardProgress,
    PosedStart,
    StartCfg,
    start_near_edge,
)
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import STANDING
from veca_marl.sim.geometry import Floats

_SHANKS = ("l_shank", "r_shank")  # their origins are the knees
_FEET = ("l_foot", "r_foot")
# lowest point of the toes in the frame of a foot, metres; the foot turns about it as its heel rises
_TOES_M = np.array([0.07, 0.0, -0.043])


@dataclass
class RunBabyCfg(StartCfg):
    """Parameters of RunBaby. Heights are for the body of 0.78 m and grow with the body.

    Attributes:
        spread_deg: Standard deviation of every joint angle at the start about the posture
            `standing`, in [0, 30].
        top_mps: Upper limit of the speed of the chest that counts.
        fallen_m: Height of the top of the chest (the base of the neck) below which the body has
            fallen, in [0, 0.5]; it is 0.61 m when standing. 0 turns this condition off.
        kneeling_m: Height of a knee joint below which the body has fallen, in [0, 0.15]; it is
            0.17 m when standing and 0.03 m when kneeling. 0 turns this condition off.
    """

    max_seconds: float = 8.0
    spread_deg: float = 2.0
    top_mps: float = 2.0
    fallen_m: float = 0.35
    kneeling_m: float = 0.07
    weights: dict[str, float] = terms(forward=0.1)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("top_mps")
        if not 0.0 <= self.fallen_m <= 0.5:
            raise ValueError(f"task.fallen_m={self.fallen_m} must be in [0, 0.5]")
        if not 0.0 <= self.kneeling_m <= 0.15:
            raise ValueError(f"task.kneeling_m={self.kneeling_m} must be in [0, 0.15]")


@register_task
class RunBaby(PosedStart):
    """A joint-level body stands at the edge of the room, faces its middle and has to run.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    velocity to the direction of its torso" and gives no numbers. In this task the velocity is
    that of the chest along the horizontal part of its forward axis. Departures: it counts at most
    as much as its component along the heading at the start, so that swaying to and fro is not
    rewarded; the distance that the chest covers counts only as far as the toes of both feet have
    come, since otherwise a body that falls forwards like a plank would be rewarded for half a
    metre; a fall terminates the episode, and so does a knee on the floor, since the task is to run
    on two feet. Otherwise an episode lasts `max_seconds`. The task has no goal: the farther, the
    better. With the default weight, 1 m adds 2.5 to the return.

    Terms:
        forward: Change of the distance covered during the step, divided by its duration, m/s. The
            distance is the smallest of three: those of the chest and of the toes of each foot from
            where they were at the start. The toes' is along the heading at the start. The chest's
            is the sum over the steps of the smaller one of its components along the horizontal
            part of its forward axis and along the heading at the start, of which at most `top_mps`
            counts in a step.
    """

    senses = ("proprioception", "touch")
    rates = ("forward",)
    body_cfg = HumanoidCfg
    cfg: RunBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        growth = self.body.growth
        self._fallen_m = self.cfg.fallen_m * growth.size
        self._kneeling_m = self.cfg.kneeling_m * growth.shank.z
        self._toes_in_foot_m = _TOES_M * growth.foot.vector
        self._chest = ForwardProgress(self.world.clock.step_s, self.cfg.top_mps)

    def reset(self, rng: np.random.Generator) -> None:
        start_near_edge(self.world, self.body, STANDING, self.cfg.spread_deg, rng)
        self._begin()

    def _begin(self) -> None:
        """Measure all distances from the present pose."""
        self._heading = self.body.forward
        self._chest.reset(self.body.bone("chest").position, self._heading)
        self._toes_start_m = self._toes_m()
        self._chest_m = self._covered_m = self._speed_mps = 0.0

    def after_step(self, rng: np.random.Generator) -> None:
        chest, step_s = self.body.bone("chest"), self.world.clock.step_s
        before_m = self._covered_m
        self._chest.update(chest.position, horizontal(chest.forward))
        self._chest_m += self._chest.speed_mps * step_s
        self._covered_m = min(self._chest_m, *(self._toes_m() - self._toes_start_m))
        self._speed_mps = (self._covered_m - before_m) / step_s

    def reward(self, player: Player) -> dict[str, float]:
        return {"forward": self._speed_mps}

    def terminated(self) -> bool:
        return self._height_m("neck") < self._fallen_m or self._kneels()

    def _toes_m(self) -> Floats:
        """Return the positions of the left and the right toes along the heading at the start."""
        feet = [self.body.bone(name) for name in _FEET]
        toes = np.array([foot.position + foot.rotation @ self._toes_in_foot_m for foot in feet])
        return np.array(toes @ self._heading)

    def _kneels(self) -> bool:
        return min(map(self._height_m, _SHANKS)) < self._kneeling_m

    def _height_m(self, bone: str) -> float:
        return float(self.body.bone(bone).position[2])
