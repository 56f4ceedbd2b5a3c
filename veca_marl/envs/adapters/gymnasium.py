"""A task of one agent as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.adapters.hosts import HERE, Host
from veca_marl.envs.adapters.seeded_game import NotCopied, SeededGame
from veca_marl.envs.adapters.spaces import Observed, Space, SpaceLayout
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.snapshot import Snapshot


class VecaGymEnv(NotCopied, gymnasium.Env[Observed, Any]):
    """One game of one agent.

    Observations are dicts with one array per sense, or one vector (`SpaceLayout.flat`);
    `info["terms"]` contains the unweighted reward terms by name, and `info["solved"]` whether the
    goal of the task is reached, if it has one; the entries of `Body.info` are beside them. The same
    seed gives the same bytes as in the first world of a `VecaEnv`.

    Args:
        cfg: What to play.
        seed: Used until `reset` is given one; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called; `human` shows each reset and step in a
            window.
        layout: Shapes of observations and actions.
        host: Where the game is played.

    Raises:
        ValueError: If the task has several agents.
    """

    def __init__(
        self,
        cfg: GameCfg,
        seed: int | None = None,
        render_mode: str | None = None,
        layout: SpaceLayout = SpaceLayout.arrays,
        host: Host = HERE,
    ) -> None:
        self._played = SeededGame(cfg, seed, render_mode, host)
        game = self._played.game
        if len(game.actors) != 1:
            self._played.close()
            raise ValueError(_too_many(cfg.task.name, self._played.names))
        (player,) = game.actors
        self._agent, self._layout = player.name, layout
        self.metadata = self._played.metadata
        self.render_mode = render_mode
        self.observation_space: Space = layout.space(game, player)
        self._actions = layout.actions(player)
        self.action_space = self._actions.space

    def __repr__(self) -> str:
        """Return the task, the agents, and what they sense and do."""
        return self._played.described("VecaGymEnv")

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Restarts the count of episodes; None continues it.
            options: `{"episode": number}` begins the episode of this number, `{"world": number}`
                that of this world of a `VecaEnv`.

        Returns:
            The observation, and an info with the entries of that of a step: terms are 0.
        """
        observations = self._played.reset(seed, options)
        # the generator of this episode, not the one that Gymnasium would make of the same seed
        if self._played.rng is not None:
            self.np_random = self._played.rng
        return self._layout.arrange(observations[self._agent]), self._played.first_info(self._agent)

    def step(self, action: Any) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Play one step.

        Raises:
            RuntimeError: If no episode is running, or the environment is closed.
            ValueError: If the action is invalid.
        """
        step = self._played.step({self._agent: self._actions.parts(action)})
        return (
            self._layout.arrange(step.observations[self._agent]),
            step.rewards[self._agent],
            step.terminated[self._agent],
            step.truncated,
            step.info(self._agent),
        )

    def snapshot(self) -> Snapshot:
        """Return the state between two steps, from which `restore` continues.

        Raises:
            RuntimeError: If no episode is running, or the environment is closed.
        """
        return self._played.snapshot()

    def restore(self, snapshot: Snapshot) -> tuple[Observed, dict[str, Any]]:
        """Return to the state of a snapshot; what follows is equal to what followed there.

        Args:
            snapshot: Of any environment with the same configuration, also of another process.

        Returns:
            The observation there, and an info as `reset` returns it.

        Raises:
            SnapshotError: If it is that of another configuration.
        """
        observations = self._played.restore(snapshot)
        if self._played.rng is not None:
            self.np_random = self._played.rng
        return self._layout.arrange(observations[self._agent]), self._played.first_info(self._agent)

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture for people, ``(360, 640, 3)``; None with `render_mode="human"`."""
        return self._played.render()

    def close(self) -> None:
        """Release the resources of the world."""
        self._played.close()


def _too_many(task: str, names: list[str]) -> str:
    return (
        f"{task} has {len(names)} agents {names}, and a Gymnasium environment has one; "
        f"use veca_marl.parallel_env({task!r})"
    )
