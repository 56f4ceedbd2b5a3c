"""A process that plays episodes of evaluations for another one."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import torch
from torch import multiprocessing

from veca_marl.algos.collection.child_processes import prepare_child
from veca_marl.algos.collection.experience import start_method
from veca_marl.algos.evaluation.evaluators import LocalEvaluator, Players
from veca_marl.algos.specs import EnvFactory

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
