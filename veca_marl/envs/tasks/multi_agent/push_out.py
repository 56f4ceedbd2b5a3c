"""The ring: what PushOut1v1 and PushOut2v2 have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, terms
from veca_marl.envs.tasks.multi_agent.contests import (
    line_up,
    look_ahead,
    on_floor,
    opponents,
    paint_disc,
)
from veca_marl.sim.geometry import Floats

_RIM_M = 0.06
_CLAY, _ROPE = (0.80, 0.62, 0.36), (0.97, 0.97, 0.92)


@dataclass
class PushOutCfg(TaskCfg):
    """The ring and how the players stand in it at the start.

    Attributes:
        radius_m: Of the ring; who has the pelvis beyond it is out.
        start_share: They start at this share of the radius from the middle.
        spread_deg: They face the middle, up to so many degrees aside.
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
    """Two teams in a ring; who leaves it is out, and the team that is left wins."""

    senses = ("vision", "touch", "proprioception")
    cfg: PushOutCfg

    def build(self) -> None:
        low, size = (np.array(part[:2]) for part in self._room())
        self.middle = low + size / 2.0
        if size.min() / 2.0 < self.cfg.radius_m:
            raise ValueError(
                f"task.radius_m={self.cfg.radius_m}: the ring does not fit into the room "
                f"{self.world.playground.rooms[0].name!r} of {size[0]} x {size[1]} m"
            )
        paint_disc(self.world, "rim", self.middle, self.cfg.radius_m, 0.004, _ROPE)
        paint_disc(self.world, "clay", self.middle, self.cfg.radius_m - _RIM_M, 0.006, _CLAY)
        self._teams = {player.team: len(self._team(player.team)) for player in self.players}
        self._playing: set[str] = set()
        self._fallen: set[str] = set()
        self._ground: dict[str, float] = {}
        self._won: dict[str, float] = {}

    def reset(self, rng: np.random.Generator) -> None:
        side = rng.uniform(-math.pi, math.pi)
        for number, team in enumerate(self._teams):
            self._line_up(team, side + number * math.pi, rng)
        look_ahead(self.players)
        self._playing = {player.name for player in self.players}
        self._fallen = set()
        self._ground = {player.name: self._area(player) for player in self.players}
        self._won = dict.fromkeys(self._ground, 0.0)

    def after_step(self, rng: np.random.Generator) -> None:
        look_ahead(self.players)
        self._playing -= self._fallen
        now = {player.name: self._area(player) for player in self.players}
        self._won = {name: self._ground[name] - area for name, area in now.items()}
        self._ground = now
        self._fallen = {name for name in self._playing if now[name] > 1.0}

    def reward(self, player: Player) -> dict[str, float]:
        ours, theirs = self._sides(player)
        fallen = sum(other.name in self._fallen for other in theirs)
        won = self._mean_won(ours) - self._mean_won(theirs)
        return {
            "push": fallen / len(ours),
            "out": -float(player.name in self._fallen),
            "ground": won / len(ours),
        }

    def terminated(self) -> bool:
        left = self._playing - self._fallen
        return any(all(p.name not in left for p in self._team(team)) for team in self._teams)

    def opponents_playing(self, player: Player) -> list[Player]:
        """Return the players of the other team that had not left the ring before this step."""
        return [p for p in opponents(player, self.players) if p.name in self._playing]

    # ---- who is where

    def _room(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        room = self.world.playground.rooms[0]
        return room.lower_m, room.size_m

    def _team(self, name: str) -> list[Player]:
        return [player for player in self.players if player.team == name]

    def _sides(self, player: Player) -> tuple[list[Player], list[Player]]:
        """Return who played until this step: of the player's team, and of the others."""
        ours = [p for p in self._team(player.team) if p.name in self._playing]
        return ours, self.opponents_playing(player)

    def _mean_won(self, side: list[Player]) -> float:
        return sum(self._won[player.name] for player in side) / len(side)

    def _area(self, player: Player) -> float:
        """Return the share of the ring's area that is nearer to the middle than a player."""
        way = player.body.position[:2] - self.middle
        return float(way @ way) / self.cfg.radius_m**2

    def _line_up(self, team: str, side_rad: float, rng: np.random.Generator) -> None:
        """Stand abreast on one side of the ring, facing the middle more or less."""
        players, distance = self._team(team), self.cfg.start_share * self.cfg.radius_m
        for number, player in enumerate(players):
            apart = math.radians(60.0) * (number - (len(players) - 1) / 2.0)
            place: Floats = self.middle + on_floor(side_rad + apart, distance)
            aside = math.radians(rng.uniform(-self.cfg.spread_deg, self.cfg.spread_deg))
            line_up(player, place, side_rad + apart + math.pi + aside)
