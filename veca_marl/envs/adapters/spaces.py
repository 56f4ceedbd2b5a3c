"""From the specs of senses and bodies to Gymnasium's spaces, which PettingZoo uses as well."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import Player
from veca_marl.sim.spec import ArraySpec

Space = gymnasium.Space[Any]


def to_space(spec: ArraySpec) -> Space:
    """Translate one array; integers without shape are a choice among `high + 1`.

    What has no bound gets those of its type: an observation is always finite, and Gymnasium's
    checker takes an infinite bound for an oversight.
    """
    dtype = np.dtype(spec.dtype)
    if dtype.kind == "i" and spec.shape == ():
        return spaces.Discrete(int(spec.high) + 1)
    limits = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
    low, high = max(spec.low, limits.min), min(spec.high, limits.max)
    return spaces.Box(low, high, spec.shape, dtype.type)


def action_space(player: Player) -> Space:
    """Return what a player can be told: a `Box`, or `Discrete` for a body that takes moves."""
    return to_space(player.body.action_spec)


def observation_space(game: Game, player: Player) -> Space:
    """Return what a player perceives: a `Dict` with one space per sense."""
    return spaces.Dict(
        {
            name: to_space(spec)
            for sense in game.senses[player.name].values()
            for name, spec in sense.specs.items()
        }
    )
