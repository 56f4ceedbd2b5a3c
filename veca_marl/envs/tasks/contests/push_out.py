"""Rules that PushOut1v1 and PushOut2v2 share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, terms
from veca_marl.envs.tasks.contests.opponents import opponents
from veca_marl.envs.tasks.player_starts import direct_gaze_ahead
from veca_marl.envs.tasks.push_out import Ring, check_ring
from veca_marl.sim.physics import PlaygroundCfg


@dataclass
class PushOutCfg(TaskCfg):
    """Parameters of PushOut1v1 and PushOut2v2.

    Attributes:
        radius_m: Radius of the ring, at least 0.5 m. A player with its pelvis beyond is out.
        start_share: Distance of the players from the middle at the start, as a share of the
            radius, in [0.3, 0.9].
        spread_deg: Largest angle at the start between the heading of a player and the direction
            of the middle, in [0, 180].
    """

    radius_m: float = 1.0
    start_share: float = 0.6
    spread_deg: float = 30.0
    weights: dict[str, float] = terms(push=1.0, out=1.0, ground=0.5)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.5 <= self.radius_m < math.inf:
            raise ValueError(f"task.radius_m={self.radius_m} must be at least 0.5 m")
        if not 0.3 <= self.start_share <= 0.9:
            raise ValueError(f"task.start_share={self.start_share} must be in [0.3, 0.9]")
        if not 0.0 <= self.spread_deg <= 180.0:
            raise ValueError(f"task.spread_deg={self.spread_deg} must be in [0, 180]")


class PushOut(Task):
    """Two teams in a ring; a player outside is out, and the team that remains wins."""

    senses = ("vision", "touch", "proprioception")
    cfg: PushOutCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_ring(cfg.radius_m, playground)

    def build(self) -> None:
        self.ring = Ring(self.world, self.cfg.radius_m)
        self._team_names = list(dict.fromkeys(player.team for player in self.players))
        self._playing: set[str] = set()
        self._newly_out: set[str] = set()
        self._area: dict[str, float] = {}
        self._gained: dict[str, float] = {}

    def reset(self, rng: np.random.Generator) -> None:
        side_rad, cfg = rng.uniform(-math.pi, math.pi), self.cfg
        placed: list[Player] = []
        for number, name in enumerate(self._team_names):
            team, team_side_rad = self._team(name), side_rad + number * math.pi
            self.ring.place_team(team, placed, team_side_rad, cfg.start_share, cfg.spread_deg, rng)
            placed += team
        direct_gaze_ahead(self.players)
        self._playing = {player.name for player in self.players}
        self._newly_out = set()
        self._area = self._areas()
        self._gained = dict.fromkeys(self._area, 0.0)

    def after_step(self, rng: np.random.Generator) -> None:
        direct_gaze_ahead(self.players)
        self._playing -= self._newly_out
        area = self._areas()
        self._gained = {name: self._area[name] - area[name] for name in area}
        self._area = area
        self._newly_out = {name for name in self._playing if area[name] > 1.0}

    def reward(self, player: Player) -> dict[str, float]:
        team = self._team(player.team)
        ours = [p for p in team if p.name in self._playing]
        theirs = self.opponents_playing(player)
        # its own exit ends the game for a player: it costs as much as that of the whole team
        lost = len(ours) if player.name in self._newly_out else self._exits(ours)
        return {
            "push": self._exits(theirs) / len(team),
            "out": -lost / len(team),
            "ground": (self._gain(ours) - self._gain(theirs)) / len(team),
        }

    def terminated(self) -> bool:
        return any(not self._is_in_ring(self._team(name)) for name in self._team_names)

    def solved(self, player: Player) -> bool:
        """Return whether all opponents are out and the player's own team is not."""
        ours = self._team(player.team)
        return self._is_in_ring(ours) and not self._is_in_ring(opponents(player, self.players))

    def _is_in_ring(self, side: list[Player]) -> bool:
        """Return whether at least one player is in the ring after this step."""
        left = self._playing - self._newly_out
        return any(player.name in left for player in side)

    def opponents_playing(self, player: Player) -> list[Player]:
        """Return the players of the other team that were in the ring before this step."""
        return [p for p in opponents(player, self.players) if p.name in self._playing]

    def _team(self, name: str) -> list[Player]:
        return [player for player in self.players if player.team == name]

    def _areas(self) -> dict[str, float]:
        return {player.name: self.ring.area_share(player.body) for player in self.players}

    def _exits(self, side: list[Player]) -> int:
        return sum(player.name in self._newly_out for player in side)

    def _gain(self, side: list[Player]) -> float:
        return sum(self._gained[player.name] for player in side)
