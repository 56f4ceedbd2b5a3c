"""Starting poses and gaze of players that move over the floor, for every kind of body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.humanoid import Humanoid
from veca_marl.sim.body.humanoid.postures import ON_ALL_FOURS
from veca_marl.sim.geometry import Floats

_HORIZON_M = 10.0


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
