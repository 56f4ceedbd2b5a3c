"""Shared parts of games between two teams on one floor: starting poses, opponents, markings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.vectors import horizontal_distance
from veca_marl.sim.physics.props import PropCfg, PropShape
from veca_marl.sim.physics.world import World

_HORIZON_M = 10.0

Colour = tuple[float, float, float]


def place_player(player: Player, place: Floats, heading_rad: float) -> None:
    """Place a player: a walker standing, a joint-level body on hands and knees.

    Args:
        player: The player.
        place: ``(2,)`` or ``(3,)`` metres; the height is ignored.
        heading_rad: Heading.
    """
    position = np.array([place[0], place[1], 0.0])
    if isinstance(player.body, Humanoid):
        player.body.place(position, heading_rad, ON_ALL_FOURS)
    else:
        player.body.place(position, heading_rad)


def direct_gaze_ahead(players: Sequence[Player]) -> None:
    """Turn the eyes of joint-level bodies to the horizon in front, as far as they turn.

    On hands and knees the face points to the floor.
    """
    for player in players:
        body = player.body
        if isinstance(body, Humanoid):
            body.look_toward_point(body.mount("head").position + _HORIZON_M * body.forward)


def opponents(player: Player, players: Sequence[Player]) -> list[Player]:
    """Return the players of other teams."""
    return [other for other in players if other.team != player.team]


def nearest(body: Body, others: Sequence[Player]) -> Body:
    """Return the body with the smallest horizontal distance; the first one in case of a tie."""
    return min(
        (other.body for other in others),
        key=lambda other: horizontal_distance(other.position, body.position),
    )


def polar_point(direction_rad: float, distance_m: float = 1.0) -> Floats:
    """Return the point of the floor at polar coordinates, ``(2,)`` metres."""
    return distance_m * np.array([math.cos(direction_rad), math.sin(direction_rad)])


def add_painted_disc(
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
