"""A task as a PettingZoo `ParallelEnv`: numpy in, numpy out, all agents at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from veca_marl.envs.adapters.hosts import HERE, Host
from veca_marl.envs.adapters.seeded_game import NotCopied, SeededGame
from veca_marl.envs.adapters.spaces import Observed, Space, SpaceLayout
from veca_marl.envs.core.game import Observation
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.snapshot import Snapshot

Infos = dict[str, dict[str, Any]]


class VecaParallelEnv(NotCopied, ParallelEnv[str, Observed, Any]):
    """One game; the agents are its players. An eliminated player is no longer in `agents`.

    Observations are dicts with one array per sense, or vectors (`SpaceLayout.flat`);
    `infos[agent]["terms"]` contains the unweighted reward terms by name, and
    `infos[agent]["solved"]` whether the goal of the task is reached, if it has one; the entries of
    `Body.info` are beside them. The same seed gives the same bytes as in the first world of a
    `VecaEnv`.

    Args:
        cfg: What to play.
        seed: Used until `reset` is given one; None is fresh entropy.
        render_mode: `rgb_array` if `render` is to be called; `human` shows each reset and step in a
            window.
        layout: Shapes of observations and actions.
        host: Where the game is played.
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
        self.metadata = self._played.metadata
        self.render_mode = render_mode
        self.possible_agents = list(self._played.names)
        self.agents: list[str] = []
        self._layout = layout
        self._actions = {player.name: layout.actions(player) for player in game.actors}
        self.observation_spaces = {p.name: layout.space(game, p) for p in game.actors}
        self.action_spaces = {name: actions.space for name, actions in self._actions.items()}
        self.state_space = Box(-np.inf, np.inf, (self._played.state_size,), np.float32)

    def __repr__(self) -> str:
        """Return the task, the agents, and what they sense and do."""
        return self._played.described("VecaParallelEnv")

    def observation_space(self, agent: str) -> Space:
        """Return the space of an agent's observations: by default a `Dict` with one per sense."""
        return self.observation_spaces[self._known(agent)]

    def action_space(self, agent: str) -> Space:
        """Return the space of an agent's actions, see `SpaceLayout.actions`."""
        return self.action_spaces[self._known(agent)]

    def _known(self, agent: str) -> str:
        if agent not in self.action_spaces:
            raise ValueError(f"unknown agent {agent!r}; there are {self.possible_agents}")
        return agent

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observed], Infos]:
        """Begin an episode.

        Args:
            seed: Restarts the count of episodes; None continues it.
            options: `{"episode": number}` begins the episode of this number, `{"world": number}`
                that of this world of a `VecaEnv`.

        Returns:
            Observations, and infos with the entries of those of a step (terms are 0), by agent.
        """
        observations = self._played.reset(seed, options)
        self.agents = list(self.possible_agents)
        infos = {name: self._played.first_info(name) for name in self.agents}
        return self._arranged(observations), infos

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Observed], dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """Play one step of those in `agents`; when the episode is over, `agents` is empty.

        Raises:
            RuntimeError: If no episode is running, or the environment is closed.
            ValueError: If an action is missing, invalid, or for an unknown agent.
        """
        step = self._played.step(self._in_parts(actions))
        names = self.agents
        self.agents = [] if step.done else self._played.playing
        return (
            self._arranged(step.observations),
            step.rewards,
            step.terminated,
            dict.fromkeys(names, step.truncated),
            {name: step.info(name) for name in names},
        )

    def _in_parts(self, actions: Any) -> Any:
        """Return actions as the game takes them; it refuses what is no mapping."""
        if not isinstance(actions, Mapping):
            return actions
        return {
            name: self._actions[name].parts(action) if name in self._actions else action
            for name, action in actions.items()
        }

    def snapshot(self) -> Snapshot:
        """Return the state between two steps, from which `restore` continues.

        Raises:
            RuntimeError: If no episode is running, or the environment is closed.
        """
        return self._played.snapshot()

    def restore(self, snapshot: Snapshot) -> tuple[dict[str, Observed], Infos]:
        """Return to the state of a snapshot; what follows is equal to what followed there.

        Args:
            snapshot: Of any environment with the same configuration, also of another process.

        Returns:
            The observations there, and infos as `reset` returns them, by agent.

        Raises:
            SnapshotError: If it is that of another configuration.
        """
        observations = self._played.restore(snapshot)
        self.agents = self._played.playing
        infos = {name: self._played.first_info(name) for name in self.agents}
        return self._arranged({name: observations[name] for name in self.agents}), infos

    def state(self) -> NDArray[np.float32]:
        """Return what the simulator knows at this moment, see `GlobalState` for its parts.

        Raises:
            RuntimeError: If no episode has begun, or the environment is closed.
        """
        return self._played.state()

    def _arranged(self, observations: Mapping[str, Observation]) -> dict[str, Observed]:
        return {name: self._layout.arrange(one) for name, one in observations.items()}

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture for people, ``(360, 640, 3)``; None with `render_mode="human"`."""
        return self._played.render()

    def close(self) -> None:
        """Release the resources of the world."""
        self._played.close()
        self.agents = []
