"""The verbs that a task needs of the bodies of its players."""

from __future__ import annotations

from veca_marl.envs.core.task import Player, require_walker
from veca_marl.sim.body.walker import Walker


def require_verbs(player: Player, *verbs: str) -> Walker:
    """Return the body of a player, for a task that needs some verbs.

    Raises:
        ValueError: If the body does not walk or lacks a verb.
    """
    walker = require_walker(player)
    missing = sorted(set(verbs) - set(walker.cfg.verbs))
    if missing:
        raise ValueError(
            f"{player.name}: this task needs the verbs {list(verbs)}; body.verbs="
            f"{list(walker.cfg.verbs)} lacks {missing}"
        )
    return walker
