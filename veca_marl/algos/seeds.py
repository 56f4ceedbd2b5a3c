"""Seeds that depend on a seed and a number."""

from __future__ import annotations

import numpy as np


def derived_seed(seed: int, number: int) -> int:
    """Return an independent 31-bit seed for each pair, of a stage or an episode for example."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0] >> 1)
