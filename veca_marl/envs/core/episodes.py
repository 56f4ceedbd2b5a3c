"""Where the randomness of each episode comes from."""

from __future__ import annotations

import numpy as np


def fresh_seed() -> int:
    """Return a seed of 128 bits drawn from the operating system's entropy."""
    entropy = np.random.SeedSequence().entropy
    assert isinstance(entropy, int)  # what numpy draws when it is given no entropy
    return entropy


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
        ValueError: If `seed` or `world` is negative.
    """

    def __init__(self, seed: int | None = None, world: int = 0) -> None:
        for name, value in (("seed", seed), ("world", world)):
            if value is not None and value < 0:
                raise ValueError(f"{name}={value} must be 0 or more")
        self.seed = fresh_seed() if seed is None else int(seed)
        self.number = 0
        self._world = world

    def next(self, number: int | None = None) -> np.random.Generator:
        """Return the generator of the next episode.

        Args:
            number: Continue with the episode of this number, 0 or more; None is the one after the
                last.

        Raises:
            ValueError: If `number` is negative.
        """
        if number is not None:
            if number < 0:
                raise ValueError(f"episode={number} must be 0 or more")
            self.number = number
        rng = np.random.default_rng([self.seed, self._world, self.number])
        self.number += 1
        return rng
