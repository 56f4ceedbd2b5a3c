"""Actions of scripted teams, which the game chooses itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from veca_marl.envs.core.actions import random_action
from veca_marl.envs.core.task import Player
from veca_marl.envs.core.team import Script


def play_script(
    script: Script,
    player: Player,
    expert_command: Callable[[Player], Any],
    rng: np.random.Generator,
) -> None:
    """Set the action of one player for the next step.

    Args:
        script: How the action is chosen.
        player: The player.
        expert_command: Returns the command of the player's expert; called for `Script.expert` only.
        rng: Random generator of the game.
    """
    if script is Script.idle:
        player.body.rest()
    elif script is Script.random:
        player.body.act(random_action(player.body.action_spec, rng))
    else:
        player.body.act(player.body.encode(expert_command(player)))
