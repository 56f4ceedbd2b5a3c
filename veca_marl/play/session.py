"""A game as it is played by a policy, step by step, for the first actor's panels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import nn
from torchrl.envs import set_exploration_type
from torchrl.envs.utils import step_mdp

from veca_marl.algos.evaluation.evaluate import (
    EXPLORATION_TYPES,
    Exploration,
    RandomTeams,
    seed_episodes,
)
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.transfer import load_actor
from veca_marl.config import Config, ConfigError, compose, one_line
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy
from veca_marl.envs.core.expert import find_expert
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.envs.core.task import SOLVED
from veca_marl.policy_paths import policy_path
from veca_marl.runs.assembly import read_specs
from veca_marl.runs.run_folder import stored_actors, stored_configuration

PolicyMaker = Callable[[VecaEnv], nn.Module]


@dataclass
class Moment:
    """What one step gave to the first actor.

    Attributes:
        observation: Its observation after the step.
        steps: Steps since the start of the episode; 0 is the start.
        unweighted: The reward terms of this step, as the task returns them.
        terms: Parts of the reward of this step, weights included.
        sums: Their sums since the start of the episode.
        solved: Whether the goal is reached; None for a task without a goal.
        done: Whether the episode has ended.
    """

    observation: dict[str, NDArray[Any]]
    steps: int = 0
    unweighted: dict[str, float] = field(default_factory=dict)
    terms: dict[str, float] = field(default_factory=dict)
    sums: dict[str, float] = field(default_factory=dict)
    solved: bool | None = None
    done: bool = False


class Session:
    """One world, in which a policy plays all actors, one episode after another.

    Attributes:
        env: The world; with the samples of the ears where the actors hear.
        game: The game in it.
        policy: The policy.
        played: What the environment returned for the last step: actions of all teams, and `next`.

    Args:
        cfg: What to play.
        make_policy: Returns the policy for the environment.
        seed: Seed of the episodes and of random actions.
        exploration: Whether the policy takes the mode of its distribution or a sample.

    Raises:
        ValueError: If the game or the policy is impossible.
    """

    def __init__(
        self, cfg: GameCfg, make_policy: PolicyMaker, seed: int, exploration: Exploration
    ) -> None:
        self.env = VecaEnv(cfg.with_waveform(), 1, seed)
        self.game: Game = self.env.games[0]
        self.policy = make_policy(self.env)
        self._playing = with_memory(self.env, self.policy)
        self._exploration = EXPLORATION_TYPES[exploration]
        self._team = next(iter(self.env.group_map))
        self._seed = seed

    @property
    def step_s(self) -> float:
        """Length of a step in seconds."""
        return self.env.cfg.clock.step_s

    @property
    def steps_per_s(self) -> int:
        """Steps per second of simulated time."""
        return self.env.cfg.clock.control_rate_hz

    @property
    def hears(self) -> bool:
        """Whether moments have the samples of the ears, `waveform`."""
        return "waveform" in list(self.env.observation_spec[self._team, "observation"].keys())

    def begin(self, episode: int) -> Moment:
        """Begin the episode of a number, from 0 on, as `evaluate` counts; return its start."""
        seed_episodes(self._playing, self._seed, episode)
        self._state: TensorDictBase = self._playing.reset()
        weights = self.game.weights
        self._moment = Moment(self._observation(self._state))
        self._moment.unweighted = dict.fromkeys(weights, 0.0)
        self._moment.terms = dict.fromkeys(weights, 0.0)
        self._moment.sums = dict.fromkeys(weights, 0.0)
        return self._moment

    def step(self) -> Moment:
        """Play one step of the present episode."""
        with torch.no_grad(), set_exploration_type(self._exploration):
            self.played = self._playing.step(self.policy(self._state))
        self._state = step_mdp(self.played)
        self._moment = self._next_moment(self.played["next"])
        return self._moment

    def _next_moment(self, step: TensorDictBase) -> Moment:
        info = {name: float(value[0, 0]) for name, value in step[self._team, "info"].items()}
        terms = {name: weight * info[name] for name, weight in self.game.weights.items()}
        before = self._moment
        return Moment(
            self._observation(step),
            before.steps + 1,
            {name: info[name] for name in terms},
            terms,
            {name: before.sums[name] + value for name, value in terms.items()},
            bool(info[SOLVED]) if SOLVED in info else None,
            bool(step["done"].all()),
        )

    def _observation(self, step: TensorDictBase) -> dict[str, NDArray[Any]]:
        senses = step[self._team, "observation"].items()
        return {name: array[0, 0].numpy(force=True).copy() for name, array in senses}

    def close(self) -> None:
        """Release the world."""
        self.env.close()


KEYBOARD, EXPERT, RANDOM = "keyboard", "expert", "random"


@dataclass(frozen=True)
class Choice:
    """What is played by which policy.

    Attributes:
        cfg: The configuration.
        make_policy: Returns the policy for an environment of its game.
        exploration: That of the run's evaluations; deterministic without a run.
    """

    cfg: Config
    make_policy: PolicyMaker
    exploration: Exploration


class InTurn(nn.Module):
    """Policies that write one after another; a later one overwrites the actions of its teams."""

    def __init__(self, policies: Sequence[nn.Module]) -> None:
        super().__init__()
        self.policies = nn.ModuleList(policies)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the actions of all teams."""
        for policy in self.policies:
            tensordict = policy(tensordict)
        return tensordict


def choose(policy: str, overrides: Sequence[str], keyboard: PolicyMaker | None = None) -> Choice:
    """Return what a policy plays.

    Args:
        policy: ``keyboard``, ``expert``, ``random``, ``zoo/NAME``, the folder of a run, or a
            checkpoint in it.
        overrides: The configuration, such as ``+task=KickTheBall``; of a run, changes of its own.
        keyboard: Returns the policy that is called ``keyboard``; None if there are no keys.

    Raises:
        ConfigError: If there is no such policy, or the configuration is impossible.
        CheckpointError: If a stored policy does not fit.
    """
    if policy == EXPERT:
        cfg = compose(overrides)
        _require_expert(cfg)
        return _with_opponents(cfg, ExpertPolicy)
    if policy == KEYBOARD and keyboard is not None:
        return _with_opponents(compose(overrides), keyboard)
    if policy == RANDOM:
        cfg = compose(overrides)
        return _with_opponents(cfg, lambda env: RandomTeams(env, list(env.group_map)))
    try:
        path = policy_path(policy)
    except ValueError as error:
        raise ConfigError(f"policy={policy}: {error}") from error
    if not path.exists():
        names = [EXPERT, RANDOM] if keyboard is None else [KEYBOARD, EXPERT, RANDOM]
        raise ConfigError(
            f"policy={policy}: choices: {', '.join(names)}, zoo/NAME, a run, a checkpoint"
        )
    return _stored(path, overrides)


def _require_expert(cfg: Config) -> None:
    try:
        find_expert(cfg.task.name)
    except ValueError as error:
        raise ConfigError(f"policy={EXPERT}: {one_line(error)}") from error


def _stored(path: Path, overrides: Sequence[str]) -> Choice:
    cfg = stored_configuration(path, overrides, "policy=")
    actors = stored_actors(cfg, path, read_specs(cfg.game))
    return Choice(cfg, lambda env: InTurn(list(actors.values())), cfg.eval.exploration)


def _with_opponents(cfg: Config, make: PolicyMaker) -> Choice:
    """Return a choice in which `opponent.TEAM=RUN` play their own policies."""
    specs = read_specs(cfg.game) if cfg.frozen else {}
    actors = {team: load_actor(path, team, specs[team]) for team, path in cfg.frozen.items()}
    return Choice(cfg, lambda env: InTurn([make(env), *actors.values()]), Exploration.deterministic)
