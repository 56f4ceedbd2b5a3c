"""A check of balls that walkers have to kick."""

from __future__ import annotations

from collections.abc import Iterable

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.physics import Prop


def check_kickable(players: Iterable[Player], ball: Prop) -> None:
    """Check that the ball of a task is light enough for all players that walk.

    Raises:
        ValueError: If a walker cannot kick it.
    """
    for player in players:
        body = player.body
        if isinstance(body, Walker) and not body.is_light(ball):
            raise ValueError(
                f"task.mass_kg={ball.cfg.mass_kg:g}: {player.name} kicks and pushes at most "
                f"body.push_limit_kg={body.cfg.push_limit_kg:g}"
            )
