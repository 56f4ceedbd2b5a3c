"""A game with its own random stream, one episode after another: what PettingZoo and Gymnasium see.

It draws, observes and computes rewards in the order of `VecaEnv`: the same seed gives the same
bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.rendering.spectator import Spectator
from veca_marl.sim.compilation import announce_compilation

RENDER_MODES = ("rgb_array",)


class Step(NamedTuple):
    """What one step gave to each player, by name.

    Attributes:
        observations: What they perceive now.
        rewards: Weighted sums of the terms.
        terms: Unweighted reward terms by name.
        terminated: For whom the game is over by its rules.
        truncated: The time is up.
        done: It is over for everyone.
    """

    observations: dict[str, Observation]
    rewards: dict[str, float]
    terms: dict[str, dict[str, float]]
    terminated: dict[str, bool]
    truncated: bool
    done: bool


class SeededGame:
    """The first world of a `VecaEnv` with the same seed, without TorchRL.

    Attributes:
        game: What is played.
        names: The players whose actions come from outside, team by team.
        rng: The generator of the episode that is running.
        metadata: What Gymnasium and PettingZoo want to know about pictures.

    Args:
        cfg: What is played.
        seed: As for `VecaEnv`; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called.

    Raises:
        ValueError: If there is no such render mode, or the seed is negative.
    """

    def __init__(self, cfg: GameCfg, seed: int | None, render_mode: str | None) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode={render_mode!r}; choices: {[None, *RENDER_MODES]}")
        announce_compilation()
        self._episodes = Episodes(seed)
        self.game = Game(cfg)
        self.names = [player.name for player in self.game.actors]
        self.metadata: dict[str, Any] = {
            "name": cfg.task.name,
            "render_modes": list(RENDER_MODES),
            "render_fps": cfg.clock.control_rate_hz,
        }
        self._spectator = Spectator(self.game)
        self._render_mode = render_mode
        self._seen: dict[str, Observation] = {}
        self._running = False

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> dict[str, Observation]:
        """Begin an episode and return what all players perceive.

        Args:
            seed: Restarts the count of episodes, as `VecaEnv.set_seed`; None continues it.
            options: `{"episode": number}` begins the episode of this number; others are ignored,
                as PettingZoo's own test demands.

        Raises:
            ValueError: If the seed or the number is negative.
        """
        if seed is not None:
            self._episodes = Episodes(seed)
        self.rng = self._episodes.next((options or {}).get("episode"))
        self.game.reset(self.rng)
        self._running = True
        return self._observe(self.names)

    def step(self, actions: Mapping[str, Any]) -> Step:
        """Play one step.

        Args:
            actions: What each player does, by name; who is out needs none.

        Returns:
            What it gave to each player who took part in it.

        Raises:
            RuntimeError: If no episode is running.
            ValueError: If an action is missing, impossible, or for a player who is not there.
        """
        if not self._running:
            raise RuntimeError("no episode is running: call reset() before step()")
        names = self.playing
        outcome = self.game.step(actions)
        self._running = not outcome.done
        return Step(
            self._observe(names),
            {name: float(self.game.pay(outcome.terms[name])) for name in names},
            {name: outcome.terms[name] for name in names},
            {name: outcome.terminated_for(name) for name in names},
            outcome.truncated,
            outcome.done,
        )

    @property
    def playing(self) -> list[str]:
        """Those of `names` who are not out."""
        return [name for name in self.names if name not in self.game.out]

    def _observe(self, names: Sequence[str]) -> dict[str, Observation]:
        """Let players perceive, into arrays of their own."""
        for player in self.game.actors:
            if player.name in names:
                seen = self.game.observe(player)
                self._seen[player.name] = {name: np.array(array) for name, array in seen.items()}
        return {name: dict(self._seen[name]) for name in names}

    def render(self) -> NDArray[np.uint8]:
        """Return what the first player perceives beside the room, ``(252, width, 3)`` uint8.

        Raises:
            RuntimeError: If the environment was made without `render_mode`, or not yet reset.
        """
        if self._render_mode is None:
            raise RuntimeError(f"made without a render_mode; choices: {list(RENDER_MODES)}")
        if not self._seen:
            raise RuntimeError("nothing to see yet: call reset() before render()")
        return self._spectator.frame(self._seen[self.names[0]])

    def close(self) -> None:
        """Give the world's resources back."""
        self._running = False
        self.game.close()
