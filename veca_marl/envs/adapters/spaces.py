"""From the specs of senses and bodies to Gymnasium's spaces, which PettingZoo uses as well."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from veca_marl.envs.core.actions import from_parts
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
    if spec.is_discrete:
        return spaces.Discrete(int(spec.high) + 1)
    limits = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
    low, high = max(spec.low, limits.min), min(spec.high, limits.max)
    return spaces.Box(low, high, spec.shape, dtype.type)


def action_space(player: Player) -> Space:
    """Return the space of a player's actions.

    A `Box` or a `Discrete` for a body whose action has one part; a `Dict` of these if it has
    several.
    """
    parts = {part: to_space(spec) for part, spec in player.body.action_spec.items()}
    only = from_parts(parts)
    return spaces.Dict(parts) if isinstance(only, dict) else only


def observation_space(game: Game, player: Player) -> Space:
    """Return what a player perceives: a `Dict` with one space per sense."""
    return spaces.Dict(
        {
            name: to_space(spec)
            for sense in game.senses[player.name].values()
            for name, spec in sense.specs.items()
        }
    )
