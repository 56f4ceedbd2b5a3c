"""A check that what a task places at random fits into a playground, before a world is built."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

TRIALS = 20
"""Number of placements that are tried.

Where one episode in ten would find no places, 20 trials show it with a probability of 0.88.
"""


def check_placement(
    place: Callable[[np.random.Generator], object], asked: str, choice: str
) -> None:
    """Try out a random placement with fixed generators.

    A task draws places at the start of an episode until they fit, some hundred times at most. A
    trial that finds none stands for episodes that would fail at their start.

    Args:
        place: Draws the places of one episode, and raises `ValueError` if it finds none. It is
            called `TRIALS` times: what does not depend on the generator is better found before.
        asked: The values of the task that matter, for the message.
        choice: What to choose instead, for the message.

    Raises:
        ValueError: If a trial finds no places.
    """
    try:
        for seed in range(TRIALS):
            place(np.random.default_rng(seed))
    except ValueError as error:
        raise ValueError(f"{asked}: {error}; choose {choice}") from None
