"""Evaluators: episodes are played in this process, or in several at the same time."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Protocol

import torch
from torch import multiprocessing, nn
from torchrl.envs import EnvBase

from veca_marl.algos.collection.answers import CHECK_S, no_answer
from veca_marl.algos.collection.child_processes import (
    call_when_a_child_ends,
    end_of,
    interrupts_blocked,
    prepare_child,
)
from veca_marl.algos.collection.experience import start_method
from veca_marl.algos.collection.workers import WorkerError
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
    """Plays in worlds of this process.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        worlds: Number of worlds.
    """

    def __init__(self, make_env: EnvFactory, players: Players, worlds: int) -> None:
        self._env = make_env(worlds, 0)
        self._players = players(self._env)

    def count_steps(self, steps: Any) -> None:
        """Add 1 to ``steps.value`` before each action: another process sees that this one plays."""

        def count(*_: Any) -> None:
            steps.value += 1

        for player in self._players.values():
            player.register_forward_pre_hook(count)

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


END_S = 3.0
"""Seconds until a process that does not follow SIGTERM is killed; others end at once."""
_THREADS = 1  # of each process


@dataclass(frozen=True)
class EvaluationProcess:
    """A process that plays, as seen from the one that started it.

    Attributes:
        process: The process.
        connection: Requests go there, answers come from it.
        steps: Shared with the process, which counts its steps in it.
    """

    process: BaseProcess
    connection: Connection[Any, Any]
    steps: Any

    @property
    def waitables(self) -> list[Any]:
        """What becomes ready when it answers or ends."""
        return [self.connection, self.process.sentinel]

    def kill(self) -> None:
        """Kill the process, also one that is stopped and receives no SIGTERM."""
        self.process.kill()
        self.process.join(END_S)


class IdleTimer:
    """Measures for how long a process has made no step.

    Args:
        worker: The process.
    """

    def __init__(self, worker: EvaluationProcess) -> None:
        self._worker = worker
        self._steps, self._since = worker.steps.value, time.monotonic()

    def idle_s(self) -> float:
        """Return the seconds since this method, or the constructor, first saw the last step."""
        steps = self._worker.steps.value
        if steps != self._steps:
            self._steps, self._since = steps, time.monotonic()
        return time.monotonic() - self._since


def start_process(make_env: EnvFactory, players: Players, worlds: int) -> EvaluationProcess:
    """Start a process; it ends with this one.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        worlds: Number of worlds.
    """
    context: Any = multiprocessing.get_context(start_method(_THREADS))
    connection, child_connection = context.Pipe()
    steps = context.RawValue("Q", 0)
    arguments = (child_connection, steps, os.getpid(), make_env, players, worlds)
    process = context.Process(target=_serve, args=arguments, daemon=True)
    process.start()
    child_connection.close()
    return EvaluationProcess(process, connection, steps)


def _serve(connection: Connection[Any, Any], steps: Any, parent: int, *arguments: Any) -> None:
    """Answer requests with scores, or with the text of an exception, until this process ends.

    Args:
        connection: Requests come from it, answers go there.
        steps: Shared with the parent; its value grows by 1 with each step.
        parent: Process id of the parent.
        *arguments: Of `LocalEvaluator`.
    """
    prepare_child(parent)
    torch.set_num_threads(_THREADS)
    try:
        evaluator = LocalEvaluator(*arguments)
        evaluator.count_steps(steps)
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


class ParallelEvaluator:
    """Plays equal parts of the episodes in several processes.

    The parameters and buffers of the policies are in shared memory: a change in this process
    reaches the others. So are the numbers of steps that the processes have made, by which one that
    hangs is told from one that plays long episodes.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment, in each process.
        processes: Number of processes.
        worlds: Number of worlds of all processes, rounded up to equal numbers.
        answer_limit_s: Seconds that a process may take for its worlds, for a step of them, or for
            its answer after the last one.

    Raises:
        WorkerError: If a process ends, from every method, or does not answer in time.
    """

    def __init__(
        self,
        make_env: EnvFactory,
        players: Players,
        processes: int,
        worlds: int,
        answer_limit_s: float,
    ) -> None:
        players.policy.share_memory()
        self._limit_s = answer_limit_s
        worlds_each = math.ceil(worlds / processes)
        with interrupts_blocked():
            self._workers = [
                start_process(make_env, players, worlds_each) for _ in range(processes)
            ]
        self._expected = True  # whether all processes should run
        self._restore_handler = call_when_a_child_ends(self.check)

    def check(self) -> None:
        """Raise `WorkerError` if a process has ended; called as soon as one does."""
        for index, worker in enumerate(self._workers):
            if self._expected and worker.process.exitcode is not None:
                self._expected = False
                raise WorkerError(f"evaluation process {index} {end_of(worker.process)}")

    def play(self, request: Request, meanwhile: Callable[[], None] = nothing) -> dict[str, Scores]:
        """See `Evaluator`."""
        parts = _split(request, len(self._workers))
        for index, part in enumerate(parts):
            with self._worker_errors(index):
                self._workers[index].connection.send(part)
        meanwhile()
        answers = self._answers(len(parts))
        return joined_scores([answers[index] for index in range(len(parts))])

    def _answers(self, parts: int) -> dict[int, dict[str, Scores]]:
        """Return the answers of the first processes by index; raise if some do not answer."""
        answers: dict[int, dict[str, Scores]] = {}
        playing = {i: IdleTimer(worker) for i, worker in enumerate(self._workers[:parts])}
        while playing:
            waitables = [one for index in playing for one in self._workers[index].waitables]
            ready = wait(waitables, CHECK_S)
            for index in list(playing):
                if any(one in ready for one in self._workers[index].waitables):
                    answers[index] = self._receive(index)
                    del playing[index]
            silent = [i for i, timer in playing.items() if timer.idle_s() > self._limit_s]
            if silent:
                self._abandon(silent)
        return answers

    def _abandon(self, silent: list[int]) -> None:
        """Kill all processes and raise `WorkerError`, which names those that have not answered."""
        self._expected = False  # the signal that they have ended is to raise no other error
        for worker in self._workers:
            worker.kill()
        raise WorkerError(
            no_answer("evaluation process", silent, len(self._workers), self._limit_s)
        )

    def _receive(self, index: int) -> dict[str, Scores]:
        """Return the answer of a process that has answered or ended."""
        with self._worker_errors(index):
            if not self._workers[index].connection.poll():
                raise EOFError
            answer = self._workers[index].connection.recv()
        if isinstance(answer, str):
            self._expected = False
            raise WorkerError(f"evaluation process {index}: {answer}")
        scores: dict[str, Scores] = answer
        return scores

    @contextmanager
    def _worker_errors(self, index: int) -> Iterator[None]:
        """Raise `WorkerError` instead of an error of the pipe if the process has ended."""
        try:
            yield
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._workers[index].process.join(END_S)
            self.check()
            raise

    def close(self) -> None:
        """End the processes."""
        self._expected = False
        self._restore_handler()
        for worker in self._workers:
            worker.connection.close()
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join(END_S)
            if worker.process.is_alive():
                worker.kill()


def _split(request: Request, parts: int) -> list[Request]:
    """Return requests for consecutive episodes, as equal in number as possible, none empty."""
    bounds = [request.episodes * i // parts for i in range(parts + 1)]
    return [
        replace(request, episodes=high - low, first=request.first + low)
        for low, high in pairwise(bounds)
        if low < high
    ]


def make_evaluator(
    make_env: EnvFactory, players: Players, processes: int, worlds: int, answer_limit_s: float
) -> Evaluator:
    """Return an evaluator with a number of processes; with none it plays in this process.

    Args:
        make_env: Makes the worlds.
        players: Makes the policies for an environment.
        processes: Number of worker processes.
        worlds: Number of worlds of all processes.
        answer_limit_s: See `ParallelEvaluator`; not used without worker processes.
    """
    if processes == 0:
        return LocalEvaluator(make_env, players, worlds)
    return ParallelEvaluator(make_env, players, min(processes, worlds), worlds, answer_limit_s)
