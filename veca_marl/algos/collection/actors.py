"""Collectors in Ray's actors on this or other machines, and their supervision: extra ``[ray]``.

`RayCollector` waits without limit for actors, also for those for which no node has a free core.
`SupervisedRayCollector` raises `WorkerError` as soon as one of them has ended while others are
waited for, and if one does not answer in time.

Parameters go through Ray's object store: TorchRL's transfer by torch.distributed waits 60 s for an
actor that has ended, and needs open ports between all machines.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from typing import Any, NoReturn

import numpy as np
import ray
import torch
from ray.exceptions import RayActorError, RayError, RayTaskError
from tensordict import TensorDict, TensorDictBase
from torch import nn
from torchrl.collectors.distributed import RayCollector

from veca_marl.algos.collection.groups import GroupCollector
from veca_marl.processes.supervision import CHECK_S, Limit, TimeLimit, WorkerError

_CLOSE_S = 2.0  # that actors may take to close their worlds before they are killed
_SAME = ("veca_marl", "torch", "torchrl", "numpy", "pybullet")
_QUIET: dict[str, Any] = {
    "include_dashboard": False,
    "configure_logging": False,
    "log_to_driver": False,
    "logging_level": "error",
}


class ActorCollector(GroupCollector):
    """The collector in an actor.

    Args:
        *args: As for `GroupCollector`.
        threads: Torch threads of the actor.
        versions: Versions of packages on the learner's machine; others give other bytes.
        **kwargs: As for `GroupCollector`.

    Raises:
        RuntimeError: If a package has another version here.
    """

    def __init__(self, *args: Any, threads: int, versions: dict[str, str], **kwargs: Any) -> None:
        for package, there in versions.items():
            if version(package) != there:
                raise RuntimeError(
                    f"{package} is {version(package)} on {ray.util.get_node_ip_address()} and "
                    f"{there} on the machine of the learner"
                )
        torch.set_num_threads(threads)
        super().__init__(*args, **kwargs)

    def __bool__(self) -> bool:
        """Be true before there is a length: Ray asks when it reports an error of `__init__`."""
        return True

    def begin(self, seed: int) -> None:
        """Seed worlds and policy as TorchRL's worker processes do."""
        self.set_seed(seed)
        torch.manual_seed(seed)
        np.random.seed(seed)  # noqa: NPY002  as they do
        self.reset()

    def take(self, weights: TensorDictBase) -> None:
        """Let the policy have new parameters and buffers."""
        TensorDict.from_module(self.policy).data.update_(weights)

    def where(self) -> tuple[str, int]:
        """Return the address of the node and the id of this process."""
        return str(ray.util.get_node_ip_address()), os.getpid()


class SupervisedRayCollector(RayCollector):
    """TorchRL's collector of Ray's actors, which raises `WorkerError` if one of them fails.

    Ray connects to the cluster that ``ray start`` has made here, or that ``RAY_ADDRESS`` names;
    without one it starts the actors on this machine. They end with this process.

    Args:
        make_envs: Makes the environment of each actor.
        policy: Writes actions, on the CPU.
        limit: Limit for the time that an actor takes to start, for a batch, a reset or new
            parameters.
        threads: Torch threads of each actor, and cores that it reserves.
        auto_register_policy_transforms: As for `Collector`.
        **kwargs: As for `RayCollector`.

    Attributes:
        where: Address of the node, and process id there, of each actor.

    Raises:
        WorkerError: If the cluster is too small, or an actor fails before all are ready.
    """

    def __init__(
        self,
        make_envs: Sequence[Callable[[], Any]],
        policy: nn.Module,
        limit: Limit,
        threads: int,
        auto_register_policy_transforms: bool,
        **kwargs: Any,
    ) -> None:
        self._limit, self._actors = limit, len(make_envs)
        self._policy = policy
        self.where: list[tuple[str, int]] = []
        own = {
            "threads": threads,
            "versions": {package: version(package) for package in _SAME},
            "auto_register_policy_transforms": auto_register_policy_transforms,
        }
        logging.getLogger("ray").setLevel(logging.ERROR)
        with _own_signals(), self._shut_down_on_failure():
            _connect(len(make_envs) * threads)
            super().__init__(
                list(make_envs),
                policy,
                sync=True,
                collector_class=ActorCollector,
                collector_kwargs=[own | {"process": i} for i in range(len(make_envs))],
                remote_configs={"num_cpus": threads, "max_restarts": 0},
                weight_sync_schemes={},
                **kwargs,
            )

    @contextmanager
    def _shut_down_on_failure(self) -> Iterator[None]:
        """End the actors if not all could be started; otherwise Ray starts anew to end them."""
        try:
            yield
        except BaseException:
            if hasattr(self, "_stop_event"):
                self.shutdown()
            raise

    def add_collectors(self, *args: Any, **kwargs: Any) -> None:
        """See the base class, which waits for the actors without limit."""
        super().add_collectors(*args, **kwargs)
        self.where = self._answers("where")

    def set_seed(self, seed: int, static_seed: bool = False) -> int:
        """Seed all actors, as worker processes are."""
        self._answers("begin", seed)
        return seed

    def reset(self) -> None:
        """Start new episodes in all worlds."""
        self._answers("reset")

    def update_policy_weights_(self, *args: Any, **kwargs: Any) -> None:
        """Send the policy's parameters and buffers to all actors."""
        self._answers("take", ray.put(TensorDict.from_module(self._policy).data.clone()))

    def iterator(self) -> Iterator[TensorDictBase]:
        """Yield batches ``(actors, worlds, steps)``."""
        while True:
            yield torch.stack(self._answers("next"))

    def shutdown(self, *args: Any, **kwargs: Any) -> None:
        """End the actors, and Ray's processes if they were started here."""
        with suppress(RayError):
            # Ray kills them: they could not tell a server that they need its worlds no longer
            if closing := [actor.shutdown.remote() for actor in self.remote_collectors]:
                ray.wait(closing, num_returns=len(closing), timeout=_CLOSE_S)
        with suppress(RayError):
            super().shutdown(*args, **kwargs)

    def _answers(self, method: str, *arguments: Any) -> list[Any]:
        """Call a method of all actors and return their answers in order."""
        calls = [getattr(actor, method).remote(*arguments) for actor in self.remote_collectors]
        return self._received(calls)

    def _received(self, calls: list[Any]) -> list[Any]:
        """Wait for calls of all actors; a failed or silent one is an error."""
        numbers = {call: i for i, call in enumerate(calls)}
        limit = TimeLimit(self._limit.seconds, self._abandon)
        waiting = list(calls)
        while waiting:
            done, waiting = ray.wait(waiting, num_returns=1, timeout=CHECK_S)
            for call in done:
                self._check(call, numbers[call])
            if not done:
                limit.check([numbers[call] for call in waiting])
        return list(ray.get(calls))

    def _check(self, call: Any, index: int) -> None:
        """Raise `WorkerError` if a call that has ended has failed."""
        try:
            ray.get(call)
        except RayTaskError as error:
            self._fail(f"{self._name(index)}: {_last_line(error)}", error)
        except RayActorError as error:
            at = " (process {1} on {0})".format(*self.where[index]) if self.where else ""
            self._fail(f"{self._name(index)}{at}: {_first_sentence(error)}", error)

    def _abandon(self, silent: list[int]) -> NoReturn:
        names = " and ".join(map(str, silent))
        self._fail(
            f"Ray actor {names} (of 0 to {self._actors - 1}) did not answer for "
            f"{self._limit.seconds:g} s ({self._limit.setting}) and was killed"
            + ("" if self.where else f"; free cores of the cluster: {_cores('available'):g}")
        )

    def _name(self, index: int) -> str:
        return f"Ray actor {index} (of 0 to {self._actors - 1})"

    def _fail(self, line: str, cause: BaseException | None = None) -> NoReturn:
        self.shutdown()
        raise WorkerError(line) from cause


def _connect(cores: int) -> None:
    """Connect to a cluster with that many cores, or start one on this machine."""
    if not ray.is_initialized():
        # of a cluster that is started here: a run reports to nobody, and its actors have the
        # priority of worker processes (Ray's default of 15 starves them on a busy machine)
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        os.environ.setdefault("RAY_worker_niceness", "0")
        try:
            _init(cores)
        except (ConnectionError, RuntimeError, RayError) as error:
            raise WorkerError(f"Ray cannot be started or reached: {_last_line(error)}") from error
    found = _cores("cluster")
    if found < cores:
        raise WorkerError(
            f"the actors need {cores} cores, collect.threads each, and the cluster of Ray has "
            f"{found:g}"
        )


def _init(cores: int) -> None:
    try:
        ray.init(num_cpus=cores, **_QUIET)
    except ValueError:  # a cluster is there; its number of cores is its own
        ray.init(**_QUIET)


def _cores(which: str) -> float:
    found = getattr(ray, f"{which}_resources")()
    return float(found.get("CPU", 0.0))


def _last_line(error: BaseException) -> str:
    """Return the line of Ray's message that says what has happened."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[-1] if lines else type(error).__name__


def _first_sentence(error: RayActorError) -> str:
    """Return what Ray says first of the end of an actor; an exception of its start as a whole.

    What follows lists causes and settings of Ray for a process that has gone.
    """
    line = _last_line(error)
    return line.partition(" Worker exit type")[0].partition(" Node Id")[0]


@contextmanager
def _own_signals() -> Iterator[None]:
    """Keep the handler of SIGTERM, which Ray replaces."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
