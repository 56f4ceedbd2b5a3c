"""A check that bodies fit through the doors of a playground."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.envs.core.task import Player
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.physics import PlaygroundCfg


def check_doorways(playground: PlaygroundCfg, players: Sequence[Player]) -> None:
    """Check that walking bodies fit through all doors.

    Heights are known where the walls are built from `PlaygroundCfg.walls`. Joint-level bodies can
    crawl and turn: they are not checked.

    Raises:
        ValueError: If a door is narrower or lower than a body.
    """
    for player in players:
        if isinstance(player.body, Walker):
            _check(playground, player.body)


def _check(playground: PlaygroundCfg, body: Walker) -> None:
    for door in playground.doors:
        if door.width_m <= 2.0 * body.cfg.radius_m:
            raise ValueError(
                f"playground {playground.name!r}: door {door.name!r} has width_m={door.width_m:g}: "
                f"{body.name} with body.radius_m={body.cfg.radius_m:g} does not fit through it"
            )
    walls = playground.walls
    if playground.doors and walls is not None and walls.door_height_m <= body.cfg.height_m:
        raise ValueError(
            f"playground {playground.name!r}: walls.door_height_m={walls.door_height_m:g} is too "
            f"low for {body.name} with body.height_m={body.cfg.height_m:g}"
        )
