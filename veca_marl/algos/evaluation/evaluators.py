"""Evaluations in this process, or in several that play parts of the episodes at the same time."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol

import torch
from torch import multiprocessing, nn
from torchrl.envs import EnvBase

from veca_marl.algos.collection.experience import start_method, workers_ignore_interrupts
from veca_marl.algos.collection.parent import end_with_parent
from veca_marl.algos.collection.workers import WorkerError, call_when_a_child_ends, end_of
from veca_marl.algos.evaluation.evaluate import (
    Exploration,
    RandomTeams,
    Scores,
    evaluate,
    joined_scores,
)
from veca_marl.algos.policy import Policy
from veca_marl.algos.specs import EnvFactory


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
        learning: Teams that learn: they act at random in the baseline, the others as ever.
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
    """Plays in worlds of this process.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        worlds: Number of worlds.
    """

    def __init__(self, make_env: EnvFactory, players: Players, worlds: int) -> None:
        self._env = make_env(worlds, 0)
        self._players = players(self._env)

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """See `Evaluator`."""
        meanwhile()
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


class ParallelEvaluator:
    """Plays equal parts of the episodes in several processes.

    The parameters and buffers of the policies are in shared memory: a change in this process
    reaches the others.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment, in each process.
        processes: Number of processes.
        worlds: Number of worlds of all processes, rounded up to equal numbers.

    Raises:
        WorkerError: If a process ends, from every method.
    """

    def __init__(
        self,
        make_env: EnvFactory,
        players: Players,
        processes: int,
        worlds: int,
    ) -> None:
        players.policy.share_memory()
        context: Any = multiprocessing.get_context(start_method())
        self._processes, self._connections = [], []
        with workers_ignore_interrupts():
            for _ in range(processes):
                here, there = context.Pipe()
                arguments = (there, os.getpid(), make_env, players, -(-worlds // processes))
                process = context.Process(target=_serve, args=arguments, daemon=True)
                process.start()
                there.close()
                self._processes.append(process)
                self._connections.append(here)
        self._expected = True  # whether all processes should run
        self._restore_handler = call_when_a_child_ends(self.check)

    def check(self) -> None:
        """Raise `WorkerError` if a process has ended; called as soon as one does."""
        for index, process in enumerate(self._processes):
            if self._expected and process.exitcode is not None:
                self._expected = False
                raise WorkerError(f"evaluation process {index} {end_of(process)}")

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """See `Evaluator`."""
        parts = _split(request, len(self._connections))
        for index, part in enumerate(parts):
            with self._worker_errors(index):
                self._connections[index].send(part)
        meanwhile()
        return joined_scores([self._receive(index) for index in range(len(parts))])

    def _receive(self, index: int) -> dict[str, Scores]:
        process, connection = self._processes[index], self._connections[index]
        with self._worker_errors(index):
            wait([connection, process.sentinel])
            if not connection.poll():
                raise EOFError
            answer = connection.recv()
        if isinstance(answer, str):
            self._expected = False
            raise WorkerError(f"evaluation process {index}: {answer}")
        scores: dict[str, Scores] = answer
        return scores

    @contextmanager
    def _worker_errors(self, index: int) -> Iterator[None]:
        """Raise `WorkerError` in place of the error of a pipe whose other end is closed."""
        try:
            yield
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._processes[index].join()
            self.check()
            raise

    def close(self) -> None:
        """End the processes."""
        self._expected = False
        self._restore_handler()
        for process, connection in zip(self._processes, self._connections, strict=True):
            connection.close()
            process.terminate()
            process.join()


def _split(request: Request, parts: int) -> list[Request]:
    """Return requests for consecutive episodes, as equal in number as possible, none empty."""
    bounds = [request.episodes * i // parts for i in range(parts + 1)]
    return [
        replace(request, episodes=high - low, first=request.first + low)
        for low, high in pairwise(bounds)
        if low < high
    ]


def _serve(connection: Connection[Any, Any], parent: int, *arguments: Any) -> None:
    """Answer requests with scores, or with the text of an exception, until this process ends."""
    end_with_parent(parent)
    if hasattr(signal, "SIGCHLD"):
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # the parent's handler is for its workers
    torch.set_num_threads(1)
    try:
        evaluator = LocalEvaluator(*arguments)
        while True:
            connection.send(evaluator.play(connection.recv()))
    except EOFError:  # the other end was closed
        return
    except Exception as error:
        connection.send(f"{type(error).__name__}: {error}")
        _wait_for_the_end(connection)  # ending before the text is read would hide it


def _wait_for_the_end(connection: Connection[Any, Any]) -> None:
    """Ignore requests until the other end is closed."""
    with suppress(EOFError):
        while True:
            connection.recv()


def make_evaluator(
    make_env: EnvFactory, players: Players, processes: int, worlds: int
) -> Evaluator:
    """Return what plays in so many processes, in this one if there are none.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        processes: Number of worker processes.
        worlds: Number of worlds of all processes.
    """
    if processes == 0:
        return LocalEvaluator(make_env, players, worlds)
    return ParallelEvaluator(make_env, players, min(processes, worlds), worlds)
