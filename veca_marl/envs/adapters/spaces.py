"""Gymnasium's spaces, which PettingZoo uses as well, from the specs of senses and bodies."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import DTypeLike, NDArray

from veca_marl.envs.core.game import Game, Observation, from_parts
from veca_marl.envs.core.task import Player
from veca_marl.sim.sense import ArraySpec

Space = gymnasium.Space[Any]
Observed = Observation | NDArray[np.float32]
"""An array for each sense, or one array of all."""


def to_space(spec: ArraySpec) -> Space:
    """Return the space of one array; an integer without shape is a choice among `high + 1`.

    A bound that the spec does not have is infinite in the space, too.
    """
    dtype = np.dtype(spec.dtype)
    if spec.is_discrete:
        return spaces.Discrete(int(spec.high) + 1)
    return spaces.Box(spec.low, spec.high, spec.shape, dtype.type)


class Actions(ABC):
    """How a library gives the actions of a player: their space, and what they mean to a game."""

    space: Space

    @abstractmethod
    def parts(self, action: Any) -> Any:
        """Return what a game takes for an action of `space`.

        Raises:
            ValueError: If it is not in `space`.
        """


@dataclass(frozen=True)
class PlainActions(Actions):
    """The action as the game takes it: one part, or a mapping of several."""

    space: Space

    def parts(self, action: Any) -> Any:
        """See `Actions`; the game checks it."""
        return action


@dataclass(frozen=True)
class DiscreteParts(Actions):
    """Several choices as one array of integers.

    Attributes:
        names: The parts, in their order.
        space: Their space.
    """

    names: tuple[str, ...]
    space: spaces.MultiDiscrete

    def parts(self, action: Any) -> Any:
        """See `Actions`."""
        values = np.asarray(action)
        if values.shape != self.space.shape or not np.issubdtype(values.dtype, np.integer):
            raise ValueError(
                f"action {action!r} must be {len(self.names)} integers, for {', '.join(self.names)}"
            )
        return {name: np.int64(value) for name, value in zip(self.names, values, strict=True)}


@dataclass(frozen=True)
class FlatActions(Actions):
    """Numbers and choices as one vector; the largest of the entries of a choice is chosen.

    Attributes:
        specs: Specs of the parts, in their order.
        space: `Box` of all entries; those of choices are from -1 to 1.
    """

    specs: Mapping[str, ArraySpec]
    space: spaces.Box

    @classmethod
    def of(cls, specs: Mapping[str, ArraySpec]) -> FlatActions:
        """Return the vector of the parts of an action."""
        lows = [np.full(_entries(spec), _bound(spec, spec.low)) for spec in specs.values()]
        highs = [np.full(_entries(spec), _bound(spec, spec.high)) for spec in specs.values()]
        low, high = np.concatenate(lows), np.concatenate(highs)
        return cls(specs, spaces.Box(low.astype(np.float32), high.astype(np.float32)))

    def parts(self, action: Any) -> Any:
        """See `Actions`."""
        vector = np.asarray(action, np.float32)
        if vector.shape != self.space.shape or not np.isfinite(vector).all():
            raise ValueError(
                f"action {action!r} must be {self.space.shape[0]} finite numbers, for "
                f"{', '.join(f'{name} ({_entries(spec)})' for name, spec in self.specs.items())}"
            )
        parts: dict[str, Any] = {}
        begin = 0
        for name, spec in self.specs.items():
            entries = vector[begin : (begin := begin + _entries(spec))]
            if spec.is_discrete and np.abs(entries).max() > 1.0:
                raise ValueError(f"action {action!r}: the entries of {name} must be in [-1, 1]")
            choice = np.int64(entries.argmax()) if spec.is_discrete else None
            parts[name] = entries.reshape(spec.shape) if choice is None else choice
        return parts


def _entries(spec: ArraySpec) -> int:
    return int(spec.high) + 1 if spec.is_discrete else math.prod(spec.shape)


def _bound(spec: ArraySpec, bound: float) -> float:
    return math.copysign(1.0, bound - 0.5) if spec.is_discrete else bound


class SpaceLayout(Enum):
    """The shapes in which an agent's senses are handed out, and its actions are taken.

    Attributes:
        arrays: Each sense in its own shape, such as `(2, 3, 84, 84)` for two colour eyes.
        stacked: Images of several eyes as one image with more channels, `(6, 84, 84)`, and every
            other sense as a vector. Stable-Baselines3 applies its CNN to images of three axes and
            flattens all others. The action is one array too, see `actions`.
        flat: All senses as one float32 vector, in the order of their names, and actions as in
            `stacked`: for libraries that take one `Box`, such as the wrappers of SuperSuit.
    """

    arrays = "arrays"
    stacked = "stacked"
    flat = "flat"

    @classmethod
    def named(cls, name: str) -> SpaceLayout:
        """Return the layout of this name.

        Raises:
            ValueError: If there is none.
        """
        if name not in cls.__members__:
            raise ValueError(f"unknown layout {name!r}; choices: {', '.join(cls.__members__)}")
        return cls(name)

    def actions(self, player: Player) -> Actions:
        """Return the form of a player's actions.

        One part is a `Box` or a `Discrete`. Several are a `Dict` of these in the layout `arrays`;
        in the others a `MultiDiscrete` if all are choices, and else a `Box`, see `FlatActions`.
        """
        specs = player.body.action_spec
        parts = {part: to_space(spec) for part, spec in specs.items()}
        only = from_parts(parts)
        if not isinstance(only, dict):
            return PlainActions(only)
        if self is SpaceLayout.arrays:
            return PlainActions(spaces.Dict(parts))
        choices = [one.n for one in parts.values() if isinstance(one, spaces.Discrete)]
        if len(choices) == len(parts):
            return DiscreteParts(tuple(parts), spaces.MultiDiscrete(choices))
        return FlatActions.of(specs)

    def space(self, game: Game, player: Player) -> Space:
        """Return the space of a player's observations: a `Dict` with one space per sense.

        In the layout `flat` it is one `Box`, of the senses in the order of their names.
        """
        specs = {
            name: spec
            for sense in game.senses[player.name].values()
            for name, spec in sense.specs.items()
        }
        if self is SpaceLayout.flat:
            return _flat_space([specs[name] for name in sorted(specs)])
        return spaces.Dict(
            {
                name: to_space(replace(spec, shape=self._shape(spec.shape, spec.dtype)))
                for name, spec in specs.items()
            }
        )

    def arrange(self, observation: Observation) -> Observed:
        """Return the arrays of an observation in the shapes of `space`."""
        if self is SpaceLayout.flat:
            rows = [observation[name].ravel() for name in sorted(observation)]
            return np.concatenate(rows, dtype=np.float32, casting="unsafe")
        return {
            name: array.reshape(self._shape(array.shape, array.dtype))
            for name, array in observation.items()
        }

    def _shape(self, shape: tuple[int, ...], dtype: DTypeLike) -> tuple[int, ...]:
        if self is SpaceLayout.arrays:
            return shape
        is_image = np.dtype(dtype) == np.uint8 and len(shape) > 2
        return (math.prod(shape[:-2]), *shape[-2:]) if is_image else (math.prod(shape),)


def _flat_space(specs: Sequence[ArraySpec]) -> spaces.Box:
    sizes = [math.prod(spec.shape) for spec in specs]
    low = np.repeat([spec.low for spec in specs], sizes).astype(np.float32)
    high = np.repeat([spec.high for spec in specs], sizes).astype(np.float32)
    return spaces.Box(low, high)
