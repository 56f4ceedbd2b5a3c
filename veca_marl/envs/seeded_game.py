"""A game with its own random stream, one episode after another: what PettingZoo and Gymnasium see.

It draws, observes and pays in the order of `VecaEnv`, so that the same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.game import Game, GameCfg, Observation
from veca_marl.envs.spectator import Spectator
from veca_marl.sim.compilation import announce_compilation

RENDER_MODES = ("rgb_array",)


class Step(NamedTuple):
    """What one step gave to each player, by name.

    Attributes:
        observations: What they perceive now.
        rewards: Weighted sums of the terms.
        terms: Unweighted reward terms by name.
        terminated: The game is over by its rules.
        truncated: The time is up.
    """

    observations: dict[str, Observation]
    rewards: dict[str, float]
    terms: dict[str, dict[str, float]]
    terminated: bool
    truncated: bool


class SeededGame:
    """The first world of a `VecaEnv` with the same seed, without TorchRL.

    Attributes:
        game: What is played.
        names: The players, team by team.
        rng: Where its randomness comes from.
        metadata: What Gymnasium and PettingZoo want to know about pictures.

    Args:
        cfg: What is played.
        seed: As for `VecaEnv`.
        render_mode: `rgb_array` if `render` is to be called.

    Raises:
        ValueError: If there is no such render mode, or the seed is negative.
    """

    def __init__(self, cfg: GameCfg, seed: int, render_mode: str | None) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode={render_mode!r}; choices: {[None, *RENDER_MODES]}")
        announce_compilation()
        self._seed(seed)
        self.game = Game(cfg)
        self.names = [player.name for player in self.game.players]
        self.metadata: dict[str, Any] = {
            "name": cfg.task.name,
            "render_modes": list(RENDER_MODES),
            "render_fps": cfg.clock.control_rate_hz,
        }
        self._spectator = Spectator(self.game)
        self._render_mode = render_mode
        self._seen: dict[str, Observation] = {}
        self._running = False

    def _seed(self, seed: int) -> None:
        if seed < 0:
            raise ValueError(f"seed={seed} must be 0 or more")
        self.rng = np.random.default_rng([seed, 0])

    def reset(self, seed: int | None = None) -> dict[str, Observation]:
        """Begin an episode and return what all players perceive.

        Args:
            seed: Starts the random stream anew, as `VecaEnv.set_seed`; None goes on with it.
        """
        if seed is not None:
            self._seed(seed)
        self.game.reset(self.rng)
        self._running = True
        return self._observe()

    def step(self, actions: Mapping[str, Any]) -> Step:
        """Play one step.

        Args:
            actions: What each player does, by name.

        Raises:
            RuntimeError: If no episode is running.
            ValueError: If an action is missing, impossible, or for a player who is not there.
        """
        self._check(actions)
        rows: dict[str, NDArray[Any]] = {name: np.asarray(actions[name]) for name in self.names}
        outcome = self.game.step(rows, self.rng)
        self._running = not (outcome.terminated or outcome.truncated)
        rewards = {name: float(self.game.pay(outcome.terms[name])) for name in self.names}
        return Step(self._observe(), rewards, outcome.terms, outcome.terminated, outcome.truncated)

    def _check(self, actions: Mapping[str, Any]) -> None:
        if not self._running:
            raise RuntimeError("no episode is running: call reset() before step()")
        unknown = sorted(set(actions) - set(self.names))
        if unknown:
            raise ValueError(f"actions for unknown agents {unknown}; there are {self.names}")
        missing = [name for name in self.names if name not in actions]
        if missing:
            raise ValueError(f"no action for {missing}; each of {self.names} needs one")

    def _observe(self) -> dict[str, Observation]:
        """Let all players perceive, into arrays of their own."""
        self._seen = {
            player.name: {name: np.array(seen) for name, seen in self.game.observe(player).items()}
            for player in self.game.players
        }
        return {name: dict(senses) for name, senses in self._seen.items()}

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
