"""Opponents of a player."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.envs.core.task import Player
from veca_marl.sim.body import Body
from veca_marl.sim.geometry import horizontal_distance


def opponents(player: Player, players: Sequence[Player]) -> list[Player]:
    """Return the players of other teams."""
    return [other for other in players if other.team != player.team]


def nearest(body: Body, others: Sequence[Player]) -> Body:
    """Return the body with the smallest horizontal distance; the first one in case of a tie."""
    return min(
        (other.body for other in others),
        key=lambda other: horizontal_distance(other.position, body.position),
    )
