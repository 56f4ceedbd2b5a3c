"""Collection of experience by worlds in this process, or in several."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import multiprocessing
from torchrl.envs import Compose, EnvBase

from veca_marl.algos.collection.groups import GroupCollector, GroupedPolicy
from veca_marl.algos.collection.workers import SupervisedCollector
from veca_marl.algos.networks.memory import memory_of, with_transform
from veca_marl.algos.specs import EnvFactory
from veca_marl.processes.cores import usable_cores
from veca_marl.processes.supervision import Limit


class Engine(Enum):
    """What runs the processes that collect; batches are the same, byte for byte.

    Attributes:
        processes: Worker processes of this machine, by TorchRL's `MultiSyncCollector`.
        ray: Actors of a cluster of Ray, by TorchRL's `RayCollector`.
    """

    processes = "processes"
    ray = "ray"


@dataclass
class CollectCfg:
    """Number of worlds that play at the same time.

    The defaults are the paper's 8 workers; the default preset, `collect=workers32`, has four times
    as many worlds and batches of the same size.

    Attributes:
        groups: Groups of worlds. A run depends on their number: each has its own random numbers.
        worlds: Worlds in each group; one call of the policy acts for all of them.
        steps: Steps of each world in a batch.
        processes: Worker processes, each of which plays as many groups; 0 plays them in this
            process. A run does not depend on their number. None is as many as there are cores, and
            at most one for each group; with actors or a server one for each group.
        threads: Torch threads of each worker process; with more than 1, workers take some seconds
            longer to start.
        answer_limit_s: Seconds that a worker process may take to start, for a batch, a reset, new
            parameters or a step of an evaluation; if one takes longer, the run ends with an error
            that names it. The default is more than a hundred times the usual duration of a batch.
        server: Address of a server that has the worlds (`veca_marl.serve`), such as
            ``tcp://host:5555``; None plays them on this machine.
        key: File with the keys of this machine for the server; None for a server without keys.
        engine: What runs the processes; with ``ray`` they are actors, each of which reserves
            `threads` cores of the cluster that ``ray start`` has made or ``RAY_ADDRESS`` names.
            Without a cluster they are on this machine.
    """

    groups: int = 2
    worlds: int = 4
    steps: int = 128
    processes: int | None = None
    threads: int = 1
    answer_limit_s: float = 600.0
    server: str | None = None
    key: str | None = None
    engine: Engine = Engine.processes

    def __post_init__(self) -> None:
        for name in ("groups", "worlds", "steps", "threads"):
            if getattr(self, name) < 1:
                raise ValueError(f"collect.{name} must be at least 1, got {getattr(self, name)}")
        if self.processes is not None and self.processes not in (0, *self._divisors):
            raise ValueError(
                f"collect.processes={self.processes} must be null, 0 or a divisor of "
                f"collect.groups={self.groups}: {', '.join(map(str, self._divisors))}"
            )
        if not self.answer_limit_s > 0:
            raise ValueError(f"collect.answer_limit_s must be positive, got {self.answer_limit_s}")
        if self.engine is Engine.ray and self.processes == 0:
            raise ValueError("collect.engine=ray needs at least 1 actor, got collect.processes=0")

    @property
    def limit(self) -> Limit:
        """Limit for the silence of a process."""
        return Limit(self.answer_limit_s, "collect.answer_limit_s")

    @property
    def _divisors(self) -> list[int]:
        return [n for n in range(1, self.groups + 1) if self.groups % n == 0]

    @property
    def all_worlds(self) -> int:
        """Worlds of all groups."""
        return self.groups * self.worlds

    def processes_on(self, cores: int) -> int:
        """Return the number of worker processes on a machine with some cores."""
        if self.processes is not None:
            return self.processes
        if self.engine is Engine.ray or self.server is not None:
            return self.groups
        return max(n for n in self._divisors if n <= max(cores, 1))

    @property
    def frames(self) -> int:
        """Frames in a batch."""
        return self.all_worlds * self.steps


def check_engine(engine: Engine) -> None:
    """Check that what runs the processes is installed.

    Raises:
        ValueError: If it is not.
    """
    if engine is Engine.ray and find_spec("ray") is None:
        raise ValueError("collect.engine=ray: Ray is not installed: pip install 'veca_marl[ray]'")


class NoExperience:
    """Stands for `Experience` where nothing is learnt from what a policy does: empty batches.

    Args:
        cfg: Worlds and steps that batches would have: they count the frames.
    """

    plays = False

    def __init__(self, cfg: CollectCfg) -> None:
        self.cfg = cfg

    def restart(self, seed: int) -> None:
        """Let random numbers depend on `seed`."""
        torch.manual_seed(seed)

    def collect(self) -> TensorDictBase:
        """Return a batch without arrays."""
        return TensorDict({}, [self.cfg.all_worlds, self.cfg.steps])

    def update_policy(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class Experience:
    """Batches of ``(worlds, steps)`` collected with `policy`, restartable from a seed.

    Attributes:
        plays: Whether worlds are stepped.

    Args:
        make_env: Makes the worlds.
        policy: Writes actions, on the CPU. New parameters reach the worlds by `update_policy`.
        cfg: Number of worlds and processes.

    Raises:
        WorkerError: If a worker process ends; also from every other method, and, where this object
            is made in the main thread, at once from whatever the main thread does.
    """

    plays = True

    def __init__(self, make_env: EnvFactory, policy: TensorDictModuleBase, cfg: CollectCfg) -> None:
        self.cfg = cfg
        self._processes = processes = cfg.processes_on(usable_cores())
        parts = max(processes, 1)
        make = partial(_make_env, make_env, cfg.all_worlds // parts, memory_of(policy))
        player = GroupedPolicy(policy, cfg.groups // parts)
        common = {
            "frames_per_batch": cfg.frames,
            "total_frames": -1,
            "auto_register_policy_transforms": False,  # cannot know which flag resets the memory
        }
        if processes == 0:
            self._collector = GroupCollector(make, player, **common)
        elif cfg.engine is Engine.ray:
            self._collector = _with_actors([make] * processes, player, cfg, common)
        else:
            threads = torch.get_num_threads()
            with _start_method(start_method(cfg.threads)):
                self._collector = SupervisedCollector(
                    [make] * processes,
                    player,
                    cat_results="stack",
                    num_threads=threads,
                    num_sub_threads=cfg.threads,
                    limit=cfg.limit,
                    **common,
                )
        self._batches: Iterator[TensorDictBase] = iter(self._collector)

    def restart(self, seed: int) -> None:
        """Start new episodes in all worlds; what follows depends on `seed` and the policy alone."""
        torch.manual_seed(seed)
        self._collector.set_seed(seed)
        if self._processes == 0:  # collectors in other processes reset their worlds
            self._collector.reset()

    def collect(self) -> TensorDictBase:
        """Return the next batch, ``(groups * worlds, steps)``."""
        if self._processes == 0:
            with threads(self.cfg.threads):
                return next(self._batches)
        batch = next(self._batches)
        return batch if batch.ndim == 2 else batch.flatten(0, 1)

    def update_policy(self) -> None:
        """Send the policy's new parameters and buffers to the workers."""
        self._collector.update_policy_weights_()

    def close(self) -> None:
        """End the worker processes and close the worlds."""
        threads = torch.get_num_threads()
        self._collector.shutdown()
        torch.set_num_threads(threads)  # torchrl adds one for each worker that ended


def _make_env(make_env: EnvFactory, worlds: int, memory: Compose | None) -> EnvBase:
    return with_transform(make_env(worlds, 0), memory)  # seeded by `restart`


def _with_actors(
    makers: list[Callable[[], EnvBase]], policy: GroupedPolicy, cfg: CollectCfg, common: Any
) -> Any:
    """Return the collector of Ray's actors; its module needs the extra ``[ray]``."""
    actors = import_module("veca_marl.algos.collection.actors")
    return actors.SupervisedRayCollector(
        makers, policy, limit=cfg.limit, threads=cfg.threads, **common
    )


@contextmanager
def _start_method(name: str) -> Iterator[None]:
    """Create workers by `name`; importing torchrl sets ``spawn`` for the whole program."""
    previous = multiprocessing.get_start_method()
    multiprocessing.set_start_method(name, force=True)
    try:
        yield
    finally:
        multiprocessing.set_start_method(previous, force=True)


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Compute with as many threads as worker processes have: others may sum in another order."""
    previous = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(previous)


def start_method(threads: int) -> str:
    """Return how workers are created: ``fork`` (0.2 s) where it is safe, else ``spawn`` (5 s).

    A process that has used CUDA must not be forked, and macOS's own libraries forbid it. A forked
    worker of several threads waits forever in its first parallel loop: OpenMP believes that the
    threads of the parent process, which a fork does not copy, are there.

    Args:
        threads: Torch threads of each worker.
    """
    safe = sys.platform == "linux" and not torch.cuda.is_initialized() and threads == 1
    return "fork" if safe else "spawn"
