"""Games of one team against another on one floor: what rings and pitches share."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import PropCfg, PropShape, World

_FAR_M = 10.0

Colour = tuple[float, float, float]


def line_up(player: Player, place: Floats, heading_rad: float) -> None:
    """Let a player start: who walks stands, a joint-level body is on hands and knees.

    Args:
        player: Who.
        place: ``(2,)`` metres on the floor plan.
        heading_rad: Where it faces.
    """
    spot = np.array([place[0], place[1], 0.0])
    if isinstance(player.body, Humanoid):
        player.body.place(spot, heading_rad, ON_ALL_FOURS)
    else:
        player.body.place(spot, heading_rad)


def look_ahead(players: Sequence[Player]) -> None:
    """Let the eyes of joint-level bodies look ahead to the horizon, as far as they turn.

    On hands and knees the face is turned to the floor.
    """
    for player in players:
        body = player.body
        if isinstance(body, Humanoid):
            body.look_toward_point(body.mount("head").position + _FAR_M * body.forward)


def opponents(player: Player, players: Sequence[Player]) -> list[Player]:
    """Return those of other teams."""
    return [other for other in players if other.team != player.team]


def nearest(body: Body, others: Sequence[Player]) -> Body:
    """Return whose pelvis is nearest to a body's, on the floor plan; on a tie the first."""
    return min(
        (other.body for other in others),
        key=lambda other: horizontal_distance(other.position, body.position),
    )


def on_floor(direction_rad: float, distance_m: float = 1.0) -> Floats:
    """Return a point of the floor plan seen from its origin, ``(2,)`` metres."""
    return distance_m * np.array([math.cos(direction_rad), math.sin(direction_rad)])


def paint_disc(
    world: World, name: str, centre: Floats, radius_m: float, top_m: float, colour: Colour
) -> None:
    """Paint a disc on the floor: seen, not felt, and no step to stumble over.

    Args:
        world: Where.
        name: Of the prop.
        centre: ``(2,)`` metres.
        radius_m: Of the disc.
        top_m: How thick the paint is; of two discs the thicker one is seen.
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
