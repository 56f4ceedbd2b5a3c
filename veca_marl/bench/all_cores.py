"""Rollouts by one process per core at the same time.

Cores that share caches, memory or, as hyper-threads, their arithmetic, are slower together than one
of them alone: the rate of all of them at once is the most that learning could reach.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Barrier

import torch

from veca_marl.algos.collection.parent import end_with_parent
from veca_marl.bench.rollouts import RandomActions
from veca_marl.envs.adapters.torchrl.env import VecaEnv

_WAIT_S = 60.0  # until all processes begin; they differ by the time to read a message


class SimultaneousRollouts:
    """Processes that make rollouts with random actions at the same time.

    Args:
        make_env: Makes the worlds of a process, in that process.
        steps: Steps of each rollout.
        processes: Number of processes.
    """

    def __init__(self, make_env: Callable[[], VecaEnv], steps: int, processes: int) -> None:
        context = get_context("spawn")  # this process may have threads, which a fork would break
        # kept: its shared memory is given to other arrays as soon as this process drops it
        self._begin = context.Barrier(processes)
        self._processes, self._connections = [], []
        for _ in range(processes):
            own_end, process_end = context.Pipe()
            arguments = (process_end, self._begin, make_env, steps, os.getpid())
            process = context.Process(target=_roll_out_on_request, args=arguments, daemon=True)
            process.start()
            process_end.close()
            self._processes.append(process)
            self._connections.append(own_end)
        self.frames_per_s()  # fills caches

    def frames_per_s(self) -> float:
        """Make one rollout in each process and return the sum of their rates.

        Raises:
            RuntimeError: If a process has ended.
        """
        try:
            for connection in self._connections:
                connection.send(True)
            return math.fsum(connection.recv() for connection in self._connections)
        except (EOFError, ConnectionError) as error:
            raise RuntimeError("a process that measures rollouts has ended") from error

    def close(self) -> None:
        """End the processes."""
        for connection, process in zip(self._connections, self._processes, strict=True):
            connection.send(False)
            process.join()
            connection.close()


def _roll_out_on_request(
    requests: Connection, begin: Barrier, make_env: Callable[[], VecaEnv], steps: int, parent: int
) -> None:
    """Answer each request by the frames per second of a rollout, until one is False."""
    end_with_parent(parent)
    torch.set_num_threads(1)
    env = make_env()
    actions = RandomActions(env, steps)
    while requests.recv():
        begin.wait(_WAIT_S)
        start = time.perf_counter()
        env.rollout(steps, actions, break_when_any_done=False)
        requests.send(steps * env.batch_size[0] / (time.perf_counter() - start))
    env.close()
