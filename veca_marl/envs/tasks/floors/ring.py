"""The ring of PushOut: painted on the floor, and where players start in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from veca_marl.envs.core.task import Player, Team
from veca_marl.envs.tasks.floors.outlines import (
    farthest_back_m,
    outlines_overlap,
    placed,
    start_outline,
)
from veca_marl.envs.tasks.floors.places import clearances_m, is_furniture, place_player
from veca_marl.sim.body import Body, BodyCfg
from veca_marl.sim.geometry import Floats
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
_MOST_DRAWS = 200
_TRIALS, _TRIAL_DRAWS = 20, 100


class RingStart(NamedTuple):
    """Where players start in a ring.

    Attributes:
        radius_m: Radius of the ring.
        share: Distance from the middle as a fraction of the radius.
        spread_deg: Largest deviation of the heading from the direction of the middle.
    """

    radius_m: float
    share: float
    spread_deg: float

    @property
    def distance_m(self) -> float:
        """Distance from the middle."""
        return self.share * self.radius_m

    @property
    def spread_rad(self) -> float:
        """The same as `spread_deg`, in radians."""
        return math.radians(self.spread_deg)

    def __str__(self) -> str:
        return f"task.start_share={self.share} of task.radius_m={self.radius_m}"


class _PlayerStart(NamedTuple):
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


def check_starts(start: RingStart, teams: Sequence[Team], bodies: Mapping[str, BodyCfg]) -> None:
    """Check that players of a size find headings at the start at which they do not overlap.

    Raises:
        ValueError: If a trial finds none.
    """
    starts = [
        _PlayerStart(start_outline(bodies[team.name]), angle_rad, start.distance_m)
        for number, team in enumerate(teams)
        for angle_rad in _angles_rad(team.size, number * math.pi)
    ]
    rng = np.random.default_rng(0)
    if all(_find_headings(starts, start.spread_rad, rng) for _ in range(_TRIALS)):
        return
    heights_m = sorted({f"{bodies[team.name].growth.height_m:.3g}" for team in teams})
    raise ValueError(
        f"{start}: players {' and '.join(heights_m)} m high overlap at their start "
        f"{start.distance_m:.2f} m from the middle; choose a greater one, or smaller bodies "
        "(body.age_months)"
    )


def _find_headings(
    starts: Sequence[_PlayerStart], spread_rad: float, rng: np.random.Generator
) -> bool:
    """Return whether one of some draws of all headings lets no two players overlap."""
    for _ in range(_TRIAL_DRAWS):
        outlines = [start.turned(rng.uniform(-spread_rad, spread_rad)) for start in starts]
        if not any(outlines_overlap(*pair) for pair in combinations(outlines, 2)):
            return True
    return False


def check_room_behind(
    start: RingStart, playground: PlaygroundCfg, bodies: Mapping[str, BodyCfg]
) -> None:
    """Check that players do not start in the walls or furniture round the ring.

    Raises:
        ValueError: If the farthest part of a body can be there.
    """
    room, outlines = playground.rooms[0], [start_outline(body) for body in bodies.values()]
    behind_m = max(farthest_back_m(outline, start.spread_rad) for outline in outlines)
    farthest_m = start.distance_m + behind_m
    away_m, nearest = _nearest_furniture(room, playground)
    wall_m = min(room.size_m[:2]) / 2.0
    if farthest_m < min(away_m, wall_m):
        return
    obstacle, at_m = repr(nearest), away_m
    if wall_m <= away_m:
        obstacle, at_m = f"the walls of {room.name!r}", wall_m
    raise ValueError(
        f"playground {playground.name!r}: {start}: players reach {farthest_m:.2f} m from the "
        f"middle of the ring at their start, and {obstacle} are {at_m:.2f} m away; choose a "
        "smaller one"
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
        start: RingStart,
        rng: np.random.Generator,
    ) -> bool:
        """Place a team side by side on one side of the ring, facing the middle.

        The headings are drawn again while its players penetrate each other, or others, at most
        `_MOST_DRAWS` times.

        Args:
            players: The players of the team.
            others: Players that have been placed before.
            side_rad: Direction of the team, seen from the middle.
            start: Distance and headings.
            rng: Random generator of the episode.

        Returns:
            Whether the last headings are free of overlaps.
        """
        angles_rad = _angles_rad(len(players), side_rad)
        for _ in range(_MOST_DRAWS):
            for player, angle_rad in zip(players, angles_rad, strict=True):
                place = self.middle + _polar_point(angle_rad, start.distance_m)
                deviation_rad = math.radians(rng.uniform(-start.spread_deg, start.spread_deg))
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
