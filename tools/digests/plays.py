"""Games that are played for a digest: by random actions, and by the experts of the tasks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

import veca_marl
from tools.digests.hashing import Digest

SEED = 3
WORLDS = 2
STEPS = 12
EXPERT_STEPS = 100


@dataclass(frozen=True)
class Choice:
    """What is made: the arguments of `veca_marl.make`, without worlds and seed."""

    task: str
    playground: str | None = None
    body: str | None = None
    senses: dict[str, str] = field(default_factory=dict)
    overrides: tuple[str, ...] = ()

    def make(self, worlds: int) -> Any:
        """Return the environment."""
        return veca_marl.make(
            self.task,
            worlds=worlds,
            playground=self.playground,
            body=self.body,
            senses=self.senses,
            seed=SEED,
            overrides=self.overrides,
        )


@dataclass(frozen=True)
class Rollout:
    """Random actions in two worlds through TorchRL, then a new episode in the second one."""

    name: str
    choice: Choice
    steps: int = STEPS

    def measure(self, digest: Digest) -> None:
        """Add all data of all steps."""
        with closing(self.choice.make(WORLDS)) as env:
            generator = torch.Generator().manual_seed(SEED)
            state = env.reset()
            add_tensordict(digest, "start", state)
            state = _play(digest, "first", env, state, generator, self.steps)
            state["_reset"] = torch.tensor([[False], [True]])
            state = env.reset(state)
            add_tensordict(digest, "restart", state)
            _play(digest, "second", env, state, generator, self.steps // 2)


def _play(
    digest: Digest, name: str, env: Any, state: Any, generator: torch.Generator, steps: int
) -> Any:
    """Play random actions, add each step to a digest; return the last state."""
    for step in range(steps):
        for key, spec in _leaves(env.full_action_spec):
            state[key] = random_action(spec, generator)
        played, state = env.step_and_maybe_reset(state)
        add_tensordict(digest, f"{name}/{step}", played)
    return state


def _leaves(spec: Any) -> Iterator[tuple[Any, Any]]:
    """Return key and spec of each action, in the order of the keys."""
    keys = spec.keys(include_nested=True, leaves_only=True)
    for key in sorted(keys, key=str):
        yield key, spec[key]


def random_action(spec: Any, generator: torch.Generator) -> torch.Tensor:
    """Draw an action uniformly.

    Args:
        spec: Its spec, bounded or categorical.
        generator: What draws it.

    Returns:
        A tensor of the shape and type of the spec.
    """
    if not spec.dtype.is_floating_point:
        return torch.randint(int(spec.space.n), spec.shape, generator=generator, dtype=spec.dtype)
    drawn = torch.rand(spec.shape, generator=generator, dtype=spec.dtype)
    action: torch.Tensor = spec.space.low + (spec.space.high - spec.space.low) * drawn
    return action


def add_tensordict(digest: Digest, name: str, data: Any) -> None:
    """Add all tensors of a TensorDict in the order of their keys."""
    leaves = data.items(include_nested=True, leaves_only=True)
    digest.add(name, {str(key): value for key, value in leaves})


@dataclass(frozen=True)
class ExpertPlay:
    """An episode that the experts of a task play for all players, without an adapter."""

    name: str
    choice: Choice
    steps: int = EXPERT_STEPS

    def measure(self, digest: Digest) -> None:
        """Add observations, reward terms and flags of each step until the episode ends."""
        with closing(self.choice.make(1)) as env:
            game = env.games[0]
            game.reset(np.random.default_rng(SEED))
            for step in range(self.steps):
                for player in game.actors:
                    _command(game, player)
                outcome = game.advance()
                digest.add(f"{step}/terms", outcome.terms)
                digest.add(f"{step}/solved", outcome.solved)
                digest.add(f"{step}/bodies", outcome.bodies)
                digest.add(f"{step}/eliminated", sorted(outcome.eliminated))
                digest.add(f"{step}/flags", [outcome.terminated, outcome.truncated])
                for player in game.players:
                    digest.add(f"{step}/{player.name}", game.observe(player))
                if outcome.done:
                    break


def _command(game: Any, player: Any) -> None:
    """Let the expert of a player act; an eliminated player rests."""
    if player.name in game.eliminated:
        player.body.rest()
        return
    expert = game.expert_of(player)
    player.body.act(player.body.encode(expert.act(game.observe(player, expert.reads))))


@dataclass(frozen=True)
class Picture:
    """A rollout, and the picture for people."""

    name: str
    choice: Choice

    def measure(self, digest: Digest) -> None:
        """Add the picture after the first step, then the rollout."""
        with closing(self.choice.make(1)) as env:
            state = env.reset()
            _play(digest, "step", env, state, torch.Generator().manual_seed(SEED), 1)
            digest.add("picture", env.render())
        Rollout(self.name, self.choice).measure(digest)


@dataclass(frozen=True)
class GymnasiumPlay:
    """Random actions through Gymnasium."""

    name: str
    task: str
    layout: str = "arrays"

    def measure(self, digest: Digest) -> None:
        """Add all steps of one episode, at most `STEPS`."""
        with closing(veca_marl.gym_env(self.task, seed=SEED, layout=self.layout)) as env:
            env.action_space.seed(SEED)
            digest.add("start", env.reset(seed=SEED))
            for step in range(STEPS):
                played = env.step(env.action_space.sample())
                digest.add(str(step), played)
                if played[2] or played[3]:
                    break


@dataclass(frozen=True)
class PettingZooPlay:
    """Random actions through PettingZoo."""

    name: str
    task: str

    def measure(self, digest: Digest) -> None:
        """Add all steps of one episode, at most `STEPS`."""
        with closing(veca_marl.parallel_env(self.task, seed=SEED)) as env:
            for number, agent in enumerate(env.possible_agents):
                env.action_space(agent).seed(SEED + number)
            digest.add("start", env.reset(seed=SEED))
            for step in range(STEPS):
                if not env.agents:
                    break
                actions = {agent: env.action_space(agent).sample() for agent in env.agents}
                digest.add(str(step), env.step(actions))
