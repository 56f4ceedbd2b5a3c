"""A check that what a task places at random fits into a playground, before a world is built."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def check_placement(
    place: Callable[[np.random.Generator], object], asked: str, choice: str
) -> None:
    """Try out a random placement with a fixed generator.

    A task draws places at the start of an episode until they fit, some hundred times at most. Where
    this trial finds none, most episodes would find none.

    Args:
        place: Draws the places of one episode, and raises `ValueError` if it finds none.
        asked: The values of the task that matter, for the message.
        choice: What to choose instead, for the message.

    Raises:
        ValueError: If the trial finds no places.
    """
    try:
        place(np.random.default_rng(0))
    except ValueError as error:
        raise ValueError(f"{asked}: {error}; choose {choice}") from None
