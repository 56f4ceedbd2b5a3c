"""SitBaby: sit up from lying on the back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, clipped_share, register_task, require_humanoid, terms
from veca_marl.envs.tasks.locomotion.motor_skills import (
    PosedStart,
    StartCfg,
    draw_posture,
    start_anywhere,
)
from veca_marl.registry import unknown
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.humanoid.postures import POSTURES


@dataclass
class SitBabyCfg(StartCfg):
    """Parameters of SitBaby. Heights are for the body of 0.78 m and grow with the body.

    Attributes:
        starts: Weights of the postures in which episodes start, by name. Other postures than
            `on_back` make a curriculum, see experiments/sitting.
        spread_deg: Standard deviation of every joint angle at the start about the posture, in
            [0, 30].
        torso_m: Height of the top of the chest (the base of the neck) when sitting upright.
        head_m: Height of the middle of the head when sitting upright.
        upright_deg: Tilt of the chest from the vertical up to which it counts as upright, in
            [0, 90).
        seat_m: Height of the pelvis below which the body sits; it is 0.05 m on the bottom, 0.11 m
            on the heels and 0.32 m when standing.
        sat: Least value of both terms at which the task is solved, in (0, 1].
    """

    max_seconds: float = 10.0
    torso_m: float = 0.31
    head_m: float = 0.40
    upright_deg: float = 30.0
    seat_m: float = 0.15
    sat: float = 0.8
    starts: dict[str, float] = terms(on_back=1.0, on_belly=0.0, on_all_fours=0.0, sitting=0.0)
    weights: dict[str, float] = terms(torso=0.02, head=0.02)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("torso_m", "head_m", "seat_m")
        if not 0.0 <= self.upright_deg < 90.0:
            raise ValueError(f"task.upright_deg={self.upright_deg} must be in [0, 90)")
        if not 0.0 < self.sat <= 1.0:
            raise ValueError(f"task.sat={self.sat} must be above 0 and at most 1")
        strange = sorted(set(self.starts) - set(POSTURES))
        if strange:
            raise ValueError(f"task.starts: {unknown('posture', strange[0], sorted(POSTURES))}")
        shares = self.starts.values()
        if not all(0.0 <= share < math.inf for share in shares) or sum(shares) == 0.0:
            raise ValueError(f"task.starts={self.starts} must be shares: 0 or more, not all 0")


@register_task
class SitBaby(PosedStart):
    """A joint-level body lies on its back at a random position in the room and has to sit up.

    The paper (table of tasks in the appendix; "Joint-level Locomotion & Control") rewards "the
    position of its torso and head" and gives no numbers. This task rewards their heights, as
    fractions of the heights when sitting upright and clipped to 1, so that standing up has the same
    reward as sitting. The torso is measured at its top, since a bridge on neck and feet raises the
    waist. Departure: the heights are multiplied by how upright the chest is, since on hands and
    knees they are three quarters of those when sitting. Any way of sitting counts: on the
    bottom, on the heels, supported by the hands. An episode lasts `max_seconds` and never
    terminates. With the default weights its return is 10 when sitting, 2 on hands and knees and 0
    when lying. The task is solved (`solved`) while both terms are at least `sat` and the pelvis is
    below `seat_m`.

    Terms:
        torso: Height of the top of the chest divided by `torso_m`, clipped to [0, 1], times the
            uprightness: the cosine of the angle between the chest's up axis and the vertical
            divided by that of `upright_deg`, clipped to [0, 1].
        head: Height of the middle of the head divided by `head_m`, clipped to [0, 1], times the
            same uprightness.
    """

    senses = ("proprioception", "touch")
    rates = ("torso", "head")
    body_cfg = HumanoidCfg
    cfg: SitBabyCfg

    def build(self) -> None:
        self.body = require_humanoid(self.players[0])
        growth = self.body.growth
        self._torso_m = self.cfg.torso_m * growth.trunk.z
        self._head_m = self.cfg.head_m * growth.sitting
        self._seat_m = self.cfg.seat_m * growth.size

    def reset(self, rng: np.random.Generator) -> None:
        posture = draw_posture(self.cfg.starts, rng)
        start_anywhere(self.world, self.body, posture, self.cfg.spread_deg, rng)

    def reward(self, player: Player) -> dict[str, float]:
        torso = clipped_share(self.body.bone("neck").position[2], self._torso_m)
        head = clipped_share(self.body.mount("head").position[2], self._head_m)
        upright = self._uprightness()
        return {"torso": upright * torso, "head": upright * head}

    def solved(self, player: Player) -> bool:
        """Return whether the body sits upright."""
        sits = self.body.bone("pelvis").position[2] < self._seat_m
        return bool(sits) and min(self.reward(player).values()) >= self.cfg.sat

    def _uprightness(self) -> float:
        whole = math.cos(math.radians(self.cfg.upright_deg))
        return clipped_share(float(self.body.bone("chest").up[2]), whole)
