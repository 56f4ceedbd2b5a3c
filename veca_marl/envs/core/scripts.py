"""Teams that play by themselves: no action comes from outside, the world decides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.task import Player, Task
from veca_marl.envs.core.team import Script
from veca_marl.sim.spec import ArraySpec

Observe = Callable[[Player], dict[str, NDArray[Any]]]


def play_script(
    script: Script, task: Task, player: Player, observe: Observe, rng: np.random.Generator
) -> None:
    """Tell one player what to do in the step that comes.

    Args:
        script: How.
        task: Whose rules the expert knows.
        player: Who.
        observe: Reads the player's senses; only the expert asks.
        rng: The game's source of randomness.
    """
    if script is Script.idle:
        player.body.rest()
    elif script is Script.random:
        player.body.act(random_row(player.body.action_spec, rng))
    else:
        player.body.act(player.body.encode(task.expert(player, observe(player))))


def random_row(spec: ArraySpec, rng: np.random.Generator) -> NDArray[Any]:
    """Draw one action row uniformly."""
    if spec.shape == ():
        return np.asarray(rng.integers(int(spec.high) + 1), spec.dtype)
    return rng.uniform(spec.low, spec.high, spec.shape).astype(spec.dtype)
