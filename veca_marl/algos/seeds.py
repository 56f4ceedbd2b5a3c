"""Seeds of worlds, and of what is derived from the seed of a run."""

from __future__ import annotations

import numpy as np
from torchrl.envs import EnvBase, TransformedEnv


def derived_seed(seed: int, number: int) -> int:
    """Return an independent 31-bit seed for each pair, of a stage or an episode for example."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0] >> 1)


def seed_worlds(env: EnvBase, seed: int, first_world: int) -> None:
    """Seed an environment that has a range of the numbered worlds of a run.

    Args:
        env: The environment. World w of one that has a `first_world`, as `VecaEnv`, then depends on
            the seed and on ``first_world + w`` alone; those of others on the number of worlds too.
        seed: Seed of all worlds.
        first_world: Number of its first world.
    """
    base = env
    while isinstance(base, TransformedEnv):
        base = base.base_env
    numbered = hasattr(base, "first_world")
    if numbered:
        base.first_world = first_world
    env.set_seed(seed if numbered else derived_seed(seed, first_world))
