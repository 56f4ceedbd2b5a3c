"""The ring of the PushOut tasks: its marking, starting poses and positions relative to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, product

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.envs.tasks.floors.places import is_furniture
from veca_marl.envs.tasks.navigation.floors.clearance import clearances_m
from veca_marl.envs.tasks.player_starts import place_player
from veca_marl.sim.body import Body
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
    ) -> None:
        """Place a team side by side on one side of the ring, facing the middle.

        The headings are drawn again while its players penetrate each other, or others.

        Args:
            players: The players of the team.
            others: Players that have been placed before.
            side_rad: Direction of the team, seen from the middle.
            start_share: Distance from the middle as a share of the radius.
            spread_deg: Largest deviation of the heading from the direction of the middle.
            rng: Random generator of the episode.

        Raises:
            ValueError: If they still do after `_MOST_DRAWS`.
        """
        middle_rank = (len(players) - 1) / 2.0
        angles_rad = [side_rad + _TEAM_SPACING_RAD * (n - middle_rank) for n in range(len(players))]
        for _ in range(_MOST_DRAWS):
            for player, angle_rad in zip(players, angles_rad, strict=True):
                place = self.middle + _polar_point(angle_rad, start_share * self.radius_m)
                deviation_rad = math.radians(rng.uniform(-spread_deg, spread_deg))
                place_player(player, place, angle_rad + math.pi + deviation_rad)
            if not self._overlap(players, others):
                return
        raise ValueError(
            f"task.start_share={start_share} of task.radius_m={self.radius_m}: players overlap in "
            f"each of {_MOST_DRAWS} starts; choose a greater one"
        )

    def _overlap(self, players: Sequence[Player], others: Sequence[Player]) -> bool:
        """Return whether two of some players, or one of them and one of others, penetrate."""
        pairs = [*combinations(players, 2), *product(players, others)]
        return any(
            penetration_m(self._world.client, one.body.body_id, other.body.body_id) > 0.0
            for one, other in pairs
        )


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
