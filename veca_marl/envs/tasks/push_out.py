"""PushOut1v1 and PushOut2v2: push all opponents out of the ring."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, Team, register_task, terms
from veca_marl.envs.tasks.floors.places import direct_gaze_ahead
from veca_marl.envs.tasks.floors.ring import (
    Ring,
    RingStart,
    check_ring,
    check_room_behind,
    check_starts,
)
from veca_marl.sim.body import Body, BodyCfg
from veca_marl.sim.geometry import horizontal_distance
from veca_marl.sim.physics import PlaygroundCfg

_RESTARTS = 20


def opponents(player: Player, players: Sequence[Player]) -> list[Player]:
    """Return the players of other teams."""
    return [other for other in players if other.team != player.team]


def nearest(body: Body, others: Sequence[Player]) -> Body:
    """Return the body with the smallest horizontal distance; the first one in case of a tie."""
    return min(
        (other.body for other in others),
        key=lambda other: horizontal_distance(other.position, body.position),
    )


@dataclass
class PushOutCfg(TaskCfg):
    """Parameters of PushOut1v1 and PushOut2v2.

    Attributes:
        radius_m: Radius of the ring, at least 0.5 m. A player with its pelvis beyond is out.
        start_share: Distance of the players from the middle at the start, as a fraction of the
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

    @property
    def start(self) -> RingStart:
        """Where players start."""
        return RingStart(self.radius_m, self.start_share, self.spread_deg)


class PushOut(Task):
    """Two teams in a ring; a player outside is out, and the team that remains wins."""

    senses = ("vision", "touch", "proprioception")
    cfg: PushOutCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_ring(cfg.radius_m, playground)

    @classmethod
    def check_distances(
        cls, cfg: Any, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
    ) -> None:
        check_starts(cfg.start, cls.teams_of(cfg), bodies)
        check_room_behind(cfg.start, playground, bodies)

    def build(self) -> None:
        self.ring = Ring(self.world, self.cfg.radius_m)
        self._team_names = list(dict.fromkeys(player.team for player in self.players))
        self._playing: set[str] = set()
        self._newly_out: set[str] = set()
        self._area: dict[str, float] = {}
        self._gained: dict[str, float] = {}

    def reset(self, rng: np.random.Generator) -> None:
        side_rad = rng.uniform(-math.pi, math.pi)
        # the headings of one team may leave none to the other: then both are drawn again
        if not any(self._place_teams(side_rad, rng) for _ in range(_RESTARTS)):
            raise ValueError(
                f"{self.cfg.start}: players overlap in each of {_RESTARTS} starts; choose a "
                "greater one"
            )
        direct_gaze_ahead(self.players)
        self._playing = {player.name for player in self.players}
        self._newly_out = set()
        self._area = self._areas()
        self._gained = dict.fromkeys(self._area, 0.0)

    def _place_teams(self, side_rad: float, rng: np.random.Generator) -> bool:
        """Place all teams, the first one on a side; return whether nobody overlaps."""
        before = list[Player]()
        for number, name in enumerate(self._team_names):
            team, team_side_rad = self._team(name), side_rad + number * math.pi
            if not self.ring.place_team(team, before, team_side_rad, self.cfg.start, rng):
                return False
            before += team
        return True

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


@register_task
class PushOut1v1(PushOut):
    """Two players in a ring that is painted on the floor; the player that leaves it loses.

    They start on opposite sides and face the middle, up to `spread_deg` to the side. A player
    is out when its pelvis is beyond the rim, whether it was pushed or not, and the episode
    terminates. The task is solved (`solved`) for a player that is in the ring when its opponent is
    out; when the time is over neither has won. The paper (table of tasks in the appendix;
    "Multi-Agent Reinforcement Learning") says "the agent must push other agents out of the ring
    to win", with joint-level actions; the ring, the start and the reward are not in the paper.
    Every term is zero-sum over `push` and `out` together and over `ground`.

    The players start on hands and knees. Departure: their eyes are turned to the horizon ahead in
    each step, because on hands and knees the face points to the floor. With `body=walker`, a
    variation that is not in the paper, they walk: two walkers in contact push each other with the
    speeds at which they walk towards each other; face to face they hold each other, from behind or
    from the side one moves the other at half its speed.

    Terms:
        push: 1 on the step in which the opponent is out, else 0.
        out: -1 on the step in which the player itself is out, else 0.
        ground: Decrease during the step of the fraction of the ring's area that is nearer to the
            middle than the player, minus that of the opponent. It is the difference of a
            potential: its sum over an episode depends only on the first and the last positions.
    """

    teams = (Team("red", shirt=1), Team("blue", shirt=0))


@register_task
class PushOut2v2(PushOut):
    """Two teams of two players in a ring; a team without players in the ring loses.

    The rules of PushOut1v1 apply to each player. An eliminated player stays where it left the
    ring, and its teammate continues alone. The task is solved (`solved`) for both players of a team
    when both opponents are out and the team is not. The players of a team start side by side. The
    paper (table of tasks in the appendix) says "agents must push agents of the opponent team out of
    the ring to win"; the rest is not in the paper. Terms are divided by the size of a full team: a
    push has the same reward with and without a mate, and a mate's exit costs the other one half as
    much as its own, so that pushing the own mate out is never rewarded. The sum over all players is
    not zero. Departure: the eyes of players on hands and knees are turned to the horizon ahead in
    each step, as in PushOut1v1.

    Terms:
        push: Number of opponents that are out since this step, divided by 2.
        out: On the step in which the player itself is out, minus the number of players that its
            team had until this step, divided by 2; on a step in which only its mate is out, -0.5.
            The sum over an episode is thus -1 for a player that is out, whatever its mate does.
        ground: Decrease during the step of the fraction of the ring's area that is nearer to the
            middle than a player, summed over the players that the team had until this step, minus
            that of the opponents, divided by 2.
    """

    teams = (Team("red", 2, shirt=1), Team("blue", 2, shirt=0))
    eliminates = True

    def is_eliminated(self, player: Player) -> bool:
        return player.name in self._newly_out
