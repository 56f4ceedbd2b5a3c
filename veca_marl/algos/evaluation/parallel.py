"""Evaluations in several processes, which play parts of the episodes at the same time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from multiprocessing.connection import wait

from veca_marl.algos.collection.answers import CHECK_S, no_answer
from veca_marl.algos.collection.child_processes import call_when_a_child_ends, end_of
from veca_marl.algos.collection.interrupts import interrupts_blocked
from veca_marl.algos.collection.workers import WorkerError
from veca_marl.algos.evaluation.evaluate import Scores, joined_scores
from veca_marl.algos.evaluation.evaluation_process import END_S, IdleTimer, start_process
from veca_marl.algos.evaluation.evaluators import (
    Evaluator,
    LocalEvaluator,
    Players,
    Request,
    nothing,
)
from veca_marl.algos.specs import EnvFactory


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
