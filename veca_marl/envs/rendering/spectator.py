"""What `render` of the environments returns, and the films of training runs."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.rendering.film import Film, FilmCfg, FilmQuality
from veca_marl.registry import unknown

RENDERED = FilmCfg(width=640, height=360, quality=FilmQuality.good)
"""The defaults of `render`."""


class Spectator:
    """Renders pictures of a game, for `render` and for videos; it never changes the game.

    Args:
        game: The game to show.
    """

    def __init__(self, game: Game) -> None:
        self._game, self._film = game, (RENDERED, Film(game, RENDERED))

    def frame(self, observation: Observation | None = None, **choices: Any) -> NDArray[np.uint8]:
        """Return the picture of this moment, ``(height, width, 3)`` uint8.

        Args:
            observation: What the shown agent observes; None reads it from the game.
            **choices: Fields of `FilmCfg` that differ from `RENDERED`. Cameras follow smoothly as
                long as they stay the same.

        Raises:
            TypeError: If there is no such field.
            ValueError: If a value is impossible.
        """
        names = [field.name for field in fields(FilmCfg)]
        for name in choices.keys() - names:
            raise TypeError(unknown("argument of render", name, names))
        cfg = replace(RENDERED, **choices)
        if cfg != self._film[0]:
            self._film = cfg, Film(self._game, cfg)
        return self._film[1].picture(observation)
