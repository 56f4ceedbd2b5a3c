"""Gymnasium's spaces, which PettingZoo uses as well, from the specs of senses and bodies."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import DTypeLike

from veca_marl.envs.core.game import Game, Observation, from_parts
from veca_marl.envs.core.task import Player
from veca_marl.sim.sense import ArraySpec

Space = gymnasium.Space[Any]


def to_space(spec: ArraySpec) -> Space:
    """Return the space of one array; an integer without shape is a choice among `high + 1`.

    A bound that the spec does not have is infinite in the space, too.
    """
    dtype = np.dtype(spec.dtype)
    if spec.is_discrete:
        return spaces.Discrete(int(spec.high) + 1)
    return spaces.Box(spec.low, spec.high, spec.shape, dtype.type)


def action_space(player: Player) -> Space:
    """Return the space of a player's actions.

    A `Box` or a `Discrete` for a body whose action has one part; a `Dict` of these if it has
    several.
    """
    parts = {part: to_space(spec) for part, spec in player.body.action_spec.items()}
    only = from_parts(parts)
    return spaces.Dict(parts) if isinstance(only, dict) else only


class SensesLayout(Enum):
    """The shapes in which an agent's senses are handed out.

    Attributes:
        arrays: Each sense in its own shape, such as `(2, 3, 84, 84)` for two colour eyes.
        stacked: Images of several eyes as one image with more channels, `(6, 84, 84)`, and every
            other sense as a vector. Stable-Baselines3 applies its CNN to images of three axes and
            flattens all others.
    """

    arrays = "arrays"
    stacked = "stacked"

    @classmethod
    def named(cls, name: str) -> SensesLayout:
        """Return the layout of this name.

        Raises:
            ValueError: If there is none.
        """
        if name not in cls.__members__:
            raise ValueError(f"unknown layout {name!r}; choices: {', '.join(cls.__members__)}")
        return cls(name)

    def space(self, game: Game, player: Player) -> spaces.Dict:
        """Return the space of a player's observations: a `Dict` with one space per sense."""
        specs = {
            name: spec
            for sense in game.senses[player.name].values()
            for name, spec in sense.specs.items()
        }
        return spaces.Dict(
            {
                name: to_space(replace(spec, shape=self._shape(spec.shape, spec.dtype)))
                for name, spec in specs.items()
            }
        )

    def arrange(self, observation: Observation) -> Observation:
        """Return the arrays of an observation in the shapes of `space`."""
        return {
            name: array.reshape(self._shape(array.shape, array.dtype))
            for name, array in observation.items()
        }

    def _shape(self, shape: tuple[int, ...], dtype: DTypeLike) -> tuple[int, ...]:
        if self is SensesLayout.arrays:
            return shape
        is_image = np.dtype(dtype) == np.uint8 and len(shape) > 2
        return (math.prod(shape[:-2]), *shape[-2:]) if is_image else (math.prod(shape),)
