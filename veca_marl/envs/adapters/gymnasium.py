"""A task of one agent as a Gymnasium environment; importing this module makes the ids known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "this door needs Gymnasium: pip install 'veca_marl[gymnasium]'", name=error.name
    ) from error

from veca_marl.api import choose
from veca_marl.envs.adapters.gymnasium_ids import register_ids
from veca_marl.envs.adapters.seeded_game import SeededGame
from veca_marl.envs.adapters.spaces import action_space, observation_space
from veca_marl.envs.core.game import Observation
from veca_marl.envs.core.game_cfg import GameCfg


class VecaGymEnv(gymnasium.Env[Observation, Any]):
    """One game of one agent.

    Observations are dicts with one array per sense, `info["terms"]` the unweighted reward terms by
    name. The same seed gives the same bytes as the first world of a `VecaEnv`.

    Args:
        cfg: What is played.
        seed: Used until `reset` is given one; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called.

    Raises:
        ValueError: If several agents play.
    """

    def __init__(
        self, cfg: GameCfg, seed: int | None = None, render_mode: str | None = None
    ) -> None:
        self._played = SeededGame(cfg, seed, render_mode)
        game = self._played.game
        if len(game.actors) != 1:
            self._played.close()
            raise ValueError(_too_many(cfg.task.name, self._played.names))
        (player,) = game.actors
        self._agent = player.name
        self.metadata = self._played.metadata
        self.render_mode = render_mode
        self.observation_space = observation_space(game, player)
        self.action_space = action_space(player)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Restarts the count of episodes; None continues it.
            options: `{"episode": number}` begins the episode of this number.

        Returns:
            The observation and an empty info.
        """
        observations = self._played.reset(seed, options)
        # the generator of this episode, not the one that Gymnasium would make of the same seed
        self.np_random = self._played.rng
        return observations[self._agent], {}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Play one step.

        Raises:
            RuntimeError: If no episode is running.
            ValueError: If the action is impossible.
        """
        step = self._played.step({self._agent: action})
        return (
            step.observations[self._agent],
            step.rewards[self._agent],
            step.terminated[self._agent],
            step.truncated,
            {"terms": dict(step.terms[self._agent])},
        )

    def render(self) -> NDArray[np.uint8]:
        """Return a picture ``(252, width, 3)``: the agent's eyes and skin, and the room."""
        return self._played.render()

    def close(self) -> None:
        """Give the world's resources back."""
        self._played.close()


def single_agent_env(
    task: str,
    *,
    playground: str | None = None,
    body: str | None = None,
    senses: Mapping[str, str] | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    render_mode: str | None = None,
) -> VecaGymEnv:
    """Make a task of one agent: what `gymnasium.make("veca_marl/<task>-v0", ...)` calls.

    The choices are those of `veca_marl.make`.

    Args:
        task: One of `veca_marl.list_tasks`.
        playground: A file of `conf/playground`; None is the task's own.
        body: A file of `conf/body`.
        senses: Sense to preset, a file of `conf/senses/<sense>`.
        seed: Used until `reset` is given one; None is fresh entropy.
        overrides: Anything else the command line takes.
        render_mode: `rgb_array` if `render` is to be called.

    Raises:
        ConfigError: If there is no such choice; the message lists those there are.
        ValueError: If the task is one for several agents, or a number is impossible.
    """
    cfg = choose(task, playground=playground, body=body, senses=senses, overrides=overrides)
    return VecaGymEnv(cfg, seed, render_mode)


def _too_many(task: str, names: list[str]) -> str:
    return (
        f"{task} is played by {len(names)} agents {names} and Gymnasium knows one; "
        f"use veca_marl.envs.adapters.pettingzoo.parallel_env({task!r})"
    )


register_ids()
