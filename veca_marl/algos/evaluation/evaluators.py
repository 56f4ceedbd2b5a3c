"""Evaluators: episodes are played in this process, or in several at the same time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Protocol

import torch
from torch import nn
from torchrl.envs import EnvBase

from veca_marl.algos.collection.experience import start_method, threads
from veca_marl.algos.evaluation.evaluate import (
    Exploration,
    RandomTeams,
    Scores,
    evaluate,
    joined_scores,
)
from veca_marl.algos.policy import Policy
from veca_marl.algos.specs import EnvFactory
from veca_marl.processes.pool import ProcessPool
from veca_marl.processes.supervision import Limit


@dataclass(frozen=True)
class Request:
    """Episodes to play.

    Attributes:
        player: Name of the policy.
        episodes: Number of episodes.
        seed: See `evaluate`.
        exploration: See `evaluate`.
        first: Number of the first episode.
    """

    player: str
    episodes: int
    seed: int
    exploration: Exploration
    first: int = 0


@dataclass(frozen=True)
class Players:
    """Makes the policies that a run evaluates.

    Attributes:
        policy: The policy of all teams.
        learning: Teams that learn: they act at random in the baseline, and the others as in every
            evaluation.
    """

    policy: Policy
    learning: tuple[str, ...]

    def __call__(self, env: EnvBase) -> dict[str, nn.Module]:
        """Return ``policy`` and ``random``."""
        others = [actor for t, actor in self.policy.actors.items() if t not in self.learning]
        return {
            "policy": self.policy.play,
            "random": RandomTeams(env, self.learning, others),
        }


def nothing() -> None:
    """Do nothing."""


class Evaluator(Protocol):
    """Plays episodes with policies that it knows by name."""

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """Return each team's scores.

        Args:
            request: The episodes.
            meanwhile: Called once: while other processes play, or else before this one does.
        """
        ...

    def close(self) -> None:
        """Close the worlds."""
        ...


class LocalEvaluator:
    """Plays in worlds of this process, with as many threads as processes that evaluate.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        worlds: Number of worlds.
        parts: Number of equal parts of the episodes, which are played one after the other.
    """

    def __init__(self, make_env: EnvFactory, players: Players, worlds: int, parts: int = 1) -> None:
        self._env, self._parts = make_env(worlds, 0), parts
        self._players = players(self._env)

    def count_steps(self, count: Callable[[], None]) -> None:
        """Call a function before each action."""
        for player in self._players.values():
            player.register_forward_pre_hook(lambda *_: count())

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """See `Evaluator`."""
        meanwhile()
        with threads(_THREADS):
            return joined_scores([self._play(part) for part in _split(request, self._parts)])

    def _play(self, request: Request) -> dict[str, Scores]:
        return evaluate(
            self._env,
            self._players[request.player],
            request.episodes,
            request.seed,
            request.exploration,
            request.first,
        )

    def close(self) -> None:
        """See `Evaluator`."""
        self._env.close()


_THREADS = 1  # of each process


def _serve_episodes(
    make_env: EnvFactory, players: Players, worlds: int, count_step: Callable[[], None]
) -> Callable[[Request], dict[str, Scores]]:
    """Return what plays in a process of a pool."""
    torch.set_num_threads(_THREADS)
    evaluator = LocalEvaluator(make_env, players, worlds)
    evaluator.count_steps(count_step)
    return evaluator.play


class ParallelEvaluator:
    """Plays equal parts of the episodes in several processes, which take one after the other.

    The parameters and buffers of the policies are in shared memory: a change in this process
    reaches the others.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment, in each process.
        processes: Number of processes.
        worlds: Number of worlds of each process.
        parts: Number of parts.
        limit: Limit for the time that a process takes for its worlds, for a step of them, or for
            its answer after the last one.

    Raises:
        WorkerError: See `ProcessPool`.
    """

    def __init__(
        self,
        make_env: EnvFactory,
        players: Players,
        processes: int,
        worlds: int,
        parts: int,
        limit: Limit,
    ) -> None:
        players.policy.share_memory()
        self._parts = parts
        serve = partial(_serve_episodes, make_env, players, worlds)
        method = start_method(_THREADS)
        self._pool = ProcessPool("evaluation process", serve, processes, limit, method)

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """See `Evaluator`."""
        parts = _split(request, self._parts)
        answers = self._pool.answers(parts)
        meanwhile()
        scores = dict(answers)
        return joined_scores([scores[number] for number in range(len(parts))])

    def close(self) -> None:
        """End the processes."""
        self._pool.close()


def _split(request: Request, parts: int) -> list[Request]:
    """Return requests for consecutive episodes, as equal in number as possible, none empty."""
    bounds = [request.episodes * i // parts for i in range(parts + 1)]
    return [
        replace(request, episodes=high - low, first=request.first + low)
        for low, high in pairwise(bounds)
        if low < high
    ]


def evaluating_processes(parts: int, processes: int, worlds: int) -> int:
    """Return the number of worker processes of an evaluator, see `make_evaluator`."""
    return min(parts, processes, worlds)


def make_evaluator(
    make_env: EnvFactory,
    players: Players,
    parts: int,
    processes: int,
    worlds: int,
    limit: Limit,
) -> Evaluator:
    """Return an evaluator with a number of processes; with none it plays in this process.

    Scores depend on the number of parts, not on that of processes: one call of a policy acts for
    the worlds of one part.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        parts: Number of parts of the episodes that can be played at the same time.
        processes: Number of worker processes.
        worlds: Number of worlds of all parts, rounded up to equal numbers.
        limit: See `ParallelEvaluator`; not used without worker processes.
    """
    processes = evaluating_processes(parts, processes, worlds)
    parts = min(parts, worlds)
    each = math.ceil(worlds / parts)
    if processes == 0:
        return LocalEvaluator(make_env, players, each, parts)
    return ParallelEvaluator(make_env, players, processes, each, parts, limit)
