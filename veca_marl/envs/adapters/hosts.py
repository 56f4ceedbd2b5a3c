"""Where the games of an environment are played: in this process, or elsewhere.

The adapters play games only through a `Host` and the methods of `Game` that it serves. A host
that plays them in another process exchanges one message per step for all worlds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.compile_ahead import CompileWorkers
from veca_marl.envs.core.game import Game, Outcome
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.global_state import GlobalState
from veca_marl.envs.rendering import Spectator
from veca_marl.sim.compilation import announce_compilation


class StateReader(Protocol):
    """Reads the state of one game, see `GlobalState`."""

    @property
    def size(self) -> int:
        """Length of the vector."""

    def read(self) -> NDArray[np.float32]:
        """Return the state at this moment, ``(size,)`` float32."""


class View(Protocol):
    """Renders one game for people, see `Spectator`."""

    def frame(self, **choices: Any) -> NDArray[np.uint8]:
        """Return the picture of this moment, ``(height, width, 3)``, see `Spectator.frame`."""


class Host(ABC):
    """Plays games."""

    @abstractmethod
    def make(self, cfg: GameCfg, worlds: int) -> list[Game]:
        """Return equal games.

        Raises:
            ValueError: If the configuration is impossible.
        """

    @abstractmethod
    def reset(self, games: Sequence[Game], rngs: Sequence[np.random.Generator]) -> None:
        """Begin an episode in each of some games, with its generator."""

    @abstractmethod
    def advance(self, games: Sequence[Game]) -> Iterator[Outcome]:
        """Simulate one agent step of each of some games, whose actions are set.

        A game may be read for the state before its step until its outcome is asked for.
        """

    @abstractmethod
    def state(self, game: Game) -> StateReader:
        """Return what reads the state of a game."""

    @abstractmethod
    def view(self, game: Game) -> View:
        """Return what renders a game."""


class ThisProcess(Host):
    """Plays games in the process that asks for them."""

    def make(self, cfg: GameCfg, worlds: int) -> list[Game]:
        """See `Host`; kernels are compiled by workers too, and that is announced."""
        announce_compilation(CompileWorkers(cfg))
        return [Game(cfg) for _ in range(worlds)]

    def reset(self, games: Sequence[Game], rngs: Sequence[np.random.Generator]) -> None:
        """See `Host`."""
        for game, rng in zip(games, rngs, strict=True):
            game.reset(rng)

    def advance(self, games: Sequence[Game]) -> Iterator[Outcome]:
        """See `Host`; a game is simulated when its outcome is asked for."""
        for game in games:
            yield game.advance()

    def state(self, game: Game) -> StateReader:
        """See `Host`."""
        return GlobalState(game)

    def view(self, game: Game) -> Spectator:
        """See `Host`."""
        return Spectator(game)


HERE = ThisProcess()
