"""PushOut1v1 and PushOut2v2: push all opponents out of the ring."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player, Task, TaskCfg, Team, register_task, terms
from veca_marl.envs.tasks.floors.outlines import (
    farthest_back_m,
    outlines_overlap,
    placed,
    start_outline,
)
from veca_marl.envs.tasks.floors.places import (
    clearances_m,
    direct_gaze_ahead,
    is_furniture,
    place_player,
)
from veca_marl.sim.body import Body, BodyCfg
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import (
    PlannedProp,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    RoomCfg,
    World,
    penetration_m,
)

Colour = tuple[float, float, float]

_RIM_M = 0.06
_CLAY, _ROPE = (0.80, 0.62, 0.36), (0.97, 0.97, 0.92)
_TEAM_SPACING_RAD = math.radians(60.0)  # between players of a team at the start
_MOST_DRAWS, _RESTARTS = 200, 20
_TRIALS, _TRIAL_DRAWS = 20, 100


class _Start(NamedTuple):
    """Where a player starts in a ring with its middle at the origin.

    Attributes:
        outline: The outline of its body, see `start_outline`.
        angle_rad: Direction of the place from the middle.
        distance_m: Distance from the middle.
    """

    outline: Floats
    angle_rad: float
    distance_m: float

    def turned(self, deviation_rad: float) -> Floats:
        """Return its placed outline, by an angle off the direction of the middle."""
        place = _polar_point(self.angle_rad, self.distance_m)
        return placed(self.outline, place, self.angle_rad + math.pi + deviation_rad)


def check_starts(cfg: PushOutCfg, teams: Sequence[Team], bodies: Mapping[str, BodyCfg]) -> None:
    """Check that players of a size find headings at the start at which they do not overlap.

    Raises:
        ValueError: If a trial finds none.
    """
    distance_m, spread_rad = cfg.start_share * cfg.radius_m, math.radians(cfg.spread_deg)
    starts = [
        _Start(start_outline(bodies[team.name]), angle_rad, distance_m)
        for number, team in enumerate(teams)
        for angle_rad in _angles_rad(team.size, number * math.pi)
    ]
    rng = np.random.default_rng(0)
    if all(_find_headings(starts, spread_rad, rng) for _ in range(_TRIALS)):
        return
    heights_m = sorted({f"{bodies[team.name].growth.height_m:.3g}" for team in teams})
    raise ValueError(
        f"task.start_share={cfg.start_share} of task.radius_m={cfg.radius_m}: players "
        f"{' and '.join(heights_m)} m high overlap at their start {distance_m:.2f} m from the "
        "middle; choose a greater one, or smaller bodies (body.age_months)"
    )


def _find_headings(starts: Sequence[_Start], spread_rad: float, rng: np.random.Generator) -> bool:
    """Return whether one of some draws of all headings lets no two players overlap."""
    for _ in range(_TRIAL_DRAWS):
        outlines = [start.turned(rng.uniform(-spread_rad, spread_rad)) for start in starts]
        if not any(outlines_overlap(*pair) for pair in combinations(outlines, 2)):
            return True
    return False


def check_room_behind(
    cfg: PushOutCfg, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
) -> None:
    """Check that players do not start in the walls or furniture round the ring.

    Raises:
        ValueError: If the farthest part of a body can be there.
    """
    room, spread_rad = playground.rooms[0], math.radians(cfg.spread_deg)
    behind_m = max(farthest_back_m(start_outline(body), spread_rad) for body in bodies.values())
    farthest_m = cfg.start_share * cfg.radius_m + behind_m
    away_m, nearest = _nearest_furniture(room, playground)
    wall_m = min(room.size_m[:2]) / 2.0
    if farthest_m < min(away_m, wall_m):
        return
    obstacle, at_m = repr(nearest), away_m
    if wall_m <= away_m:
        obstacle, at_m = f"the walls of {room.name!r}", wall_m
    raise ValueError(
        f"playground {playground.name!r}: task.start_share={cfg.start_share} of "
        f"task.radius_m={cfg.radius_m}: players reach {farthest_m:.2f} m from the middle of the "
        f"ring at their start, and {obstacle} are {at_m:.2f} m away; choose a smaller one"
    )


def check_ring(radius_m: float, playground: PlaygroundCfg) -> None:
    """Check that a ring fits into the first room, with all furniture outside of it.

    Raises:
        ValueError: If it does not.
    """
    room = playground.rooms[0]
    if min(room.size_m[:2]) / 2.0 < radius_m:
        raise ValueError(
            f"playground {playground.name!r}: task.radius_m={radius_m}: the ring does not fit into "
            f"the room {room.name!r} of {room.size_m[0]:g} x {room.size_m[1]:g} m; choose a "
            "smaller one, or playground=simple or single_room"
        )
    away_m, nearest = _nearest_furniture(room, playground)
    if away_m < radius_m:
        raise ValueError(
            f"playground {playground.name!r}: task.radius_m={radius_m}: {nearest!r} is in the "
            f"ring, {away_m:.2f} m from the middle of room {room.name!r}; choose a smaller one, "
            "or playground=simple"
        )


def _nearest_furniture(room: RoomCfg, playground: PlaygroundCfg) -> tuple[float, str]:
    """Return the distance of the nearest thing from the middle of a room, metres, and its name."""
    things = [prop for prop in playground.built_props() if is_furniture(prop)]
    middle = room.middle_m[:2]
    away = [(float(clearances_m(PlannedProp(thing), middle)), thing.name) for thing in things]
    return min(away, default=(math.inf, ""))


class Ring:
    """A ring painted on the floor of the first room of a world.

    Args:
        world: The world.
        radius_m: Radius.

    Attributes:
        middle: Middle, ``(2,)`` metres.
        radius_m: The same.
    """

    def __init__(self, world: World, radius_m: float) -> None:
        room = world.playground.rooms[0]
        low, size = np.array(room.lower_m[:2]), np.array(room.size_m[:2])
        self.middle: Floats = low + size / 2.0
        self.radius_m = radius_m
        self._world = world
        _add_painted_disc(world, "rim", self.middle, radius_m, 0.004, _ROPE)
        _add_painted_disc(world, "clay", self.middle, radius_m - _RIM_M, 0.006, _CLAY)

    def area_share(self, body: Body) -> float:
        """Return the share of the ring's area that is nearer to the middle than a body.

        It is above 1 for a body with its pelvis outside.
        """
        offset = body.position[:2] - self.middle
        return float(offset @ offset) / self.radius_m**2

    def place_team(
        self,
        players: Sequence[Player],
        others: Sequence[Player],
        side_rad: float,
        start_share: float,
        spread_deg: float,
        rng: np.random.Generator,
    ) -> bool:
        """Place a team side by side on one side of the ring, facing the middle.

        The headings are drawn again while its players penetrate each other, or others, at most
        `_MOST_DRAWS` times.

        Args:
            players: The players of the team.
            others: Players that have been placed before.
            side_rad: Direction of the team, seen from the middle.
            start_share: Distance from the middle as a share of the radius.
            spread_deg: Largest deviation of the heading from the direction of the middle.
            rng: Random generator of the episode.

        Returns:
            Whether they do not any more.
        """
        angles_rad = _angles_rad(len(players), side_rad)
        for _ in range(_MOST_DRAWS):
            for player, angle_rad in zip(players, angles_rad, strict=True):
                place = self.middle + _polar_point(angle_rad, start_share * self.radius_m)
                deviation_rad = math.radians(rng.uniform(-spread_deg, spread_deg))
                place_player(player, place, angle_rad + math.pi + deviation_rad)
            if not self._overlap(players, others):
                return True
        return False

    def _overlap(self, players: Sequence[Player], others: Sequence[Player]) -> bool:
        """Return whether two of some players, or one of them and one of others, penetrate."""
        pairs = [*combinations(players, 2), *product(players, others)]
        return any(
            penetration_m(self._world.client, one.body.body_id, other.body.body_id) > 0.0
            for one, other in pairs
        )


def _angles_rad(players: int, side_rad: float) -> list[float]:
    """Return the directions from the middle of the players of a team, side by side."""
    middle_rank = (players - 1) / 2.0
    return [side_rad + _TEAM_SPACING_RAD * (rank - middle_rank) for rank in range(players)]


def _polar_point(direction_rad: float, distance_m: float = 1.0) -> Floats:
    """Return the point of the floor at polar coordinates, ``(2,)`` metres."""
    return distance_m * np.array([math.cos(direction_rad), math.sin(direction_rad)])


def _add_painted_disc(
    world: World, name: str, centre: Floats, radius_m: float, top_m: float, colour: Colour
) -> None:
    """Add a disc to the floor that is visible and has no collision.

    Args:
        world: The world.
        name: Name of the prop.
        centre: ``(2,)`` metres.
        radius_m: Radius.
        top_m: Thickness; of two overlapping discs the thicker one is visible.
        colour: Red, green, blue in [0, 1].
    """
    world.add_prop(
        PropCfg(
            name=name,
            shape=PropShape.cylinder,
            size_m=[radius_m, top_m],
            position_m=(float(centre[0]), float(centre[1]), top_m / 2),
            colour=colour,
            tangible=False,
        )
    )


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
        check_starts(cfg, cls.teams_of(cfg), bodies)
        check_room_behind(cfg, playground, bodies)

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
                f"task.start_share={self.cfg.start_share} of task.radius_m={self.cfg.radius_m}: "
                f"players overlap in each of {_RESTARTS} starts; choose a greater one"
            )
        direct_gaze_ahead(self.players)
        self._playing = {player.name for player in self.players}
        self._newly_out = set()
        self._area = self._areas()
        self._gained = dict.fromkeys(self._area, 0.0)

    def _place_teams(self, side_rad: float, rng: np.random.Generator) -> bool:
        """Place all teams, the first one on a side; return whether nobody overlaps."""
        share, spread_deg, before = self.cfg.start_share, self.cfg.spread_deg, list[Player]()
        for number, name in enumerate(self._team_names):
            team, team_side_rad = self._team(name), side_rad + number * math.pi
            if not self.ring.place_team(team, before, team_side_rad, share, spread_deg, rng):
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
