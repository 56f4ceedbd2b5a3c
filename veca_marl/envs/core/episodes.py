"""Where the randomness of each episode comes from."""

from __future__ import annotations

import operator
from typing import SupportsIndex

import numpy as np


def fresh_seed() -> int:
    """Return a seed of 128 bits drawn from the operating system's entropy."""
    entropy = np.random.SeedSequence().entropy
    assert isinstance(entropy, int)  # what numpy draws when it is given no entropy
    return entropy


def check_integer(name: str, value: SupportsIndex, least: int = 0) -> int:
    """Return an integer that is at least `least`.

    Raises:
        ValueError: If it is another value; the message begins with its name.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise ValueError(f"{name}={value!r} must be an integer") from None
    if number < least:
        raise ValueError(f"{name}={number} must be {least} or more")
    return number


class Episodes:
    """Generators for the episodes of one world, in their order.

    The generator of an episode depends on the seed, the number of the world and the number of the
    episode alone. What happened in earlier episodes has no influence: two policies that draw
    different amounts of randomness while they play start later episodes alike.

    Attributes:
        seed: The seed in use; drawn from the operating system if none was given.
        number: The number of the episode that the next call of `next` begins.

    Args:
        seed: 0 or more; None is fresh entropy.
        world: Number of the world, 0 or more.

    Raises:
        ValueError: If `seed` or `world` is negative or no integer.
    """

    def __init__(self, seed: int | None = None, world: int = 0) -> None:
        check_integer("world", world)
        self.seed = fresh_seed() if seed is None else check_integer("seed", seed)
        self.number = 0
        self._world = world

    def next(self, number: int | None = None) -> np.random.Generator:
        """Return the generator of the next episode.

        Args:
            number: Continue with the episode of this number, 0 or more; None is the one after the
                last.

        Raises:
            ValueError: If `number` is negative or no integer.
        """
        if number is not None:
            self.number = check_integer("episode", number)
        rng = np.random.default_rng([self.seed, self._world, self.number])
        self.number += 1
        return rng
