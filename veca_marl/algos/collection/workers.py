"""Collectors in worker processes, and their supervision.

`MultiSyncCollector` waits without limit for the confirmation of new parameters: if a worker is
killed, it waits forever. `SupervisedCollector` raises `WorkerError` instead, in two ways:

- The signal SIGCHLD, which the system sends when a worker ends, raises it in the main thread at
  once: also while the main process learns or evaluates.
- Every wait for a worker checks each second whether all workers are alive. In other threads and on
  Windows, where the signal is not received, and while workers start, this is the only way.

A worker that hangs does not end: every wait has a time limit, after which the workers that have not
answered are named and all are killed.

The workers are no `ProcessPool`: TorchRL starts and ends them, and speaks with them through its own
pipes. What names and kills them is the same `ProcessGroup`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from multiprocessing.process import BaseProcess
from multiprocessing.queues import SimpleQueue
from queue import Empty
from typing import Any

from tensordict import TensorDictBase
from torch import multiprocessing, nn
from torchrl.collectors import MultiSyncCollector
from torchrl.weight_update import SharedMemWeightSyncScheme

from veca_marl.algos.collection.answers import AnswerPipe, BatchQueue
from veca_marl.algos.collection.groups import GroupCollector
from veca_marl.private_parts import torchrl_is_tested
from veca_marl.processes.children import block_interrupts, prepare_child
from veca_marl.processes.supervision import CHECK_S, Limit, ProcessGroup, WorkerError

_MESSAGE_CHARS = 1000  # with a pickle's overhead below what a pipe writes at once (4096 bytes)


class WorkerCollector(GroupCollector):
    """The collector in a worker; it sends an exception's message before the worker ends.

    Args:
        *args: As for `GroupCollector`.
        exceptions: A queue for the index of the worker and the message.
        worker_idx: Index of the worker.
        **kwargs: As for `GroupCollector`.
    """

    def __init__(self, *args: Any, exceptions: Any, worker_idx: int, **kwargs: Any) -> None:
        self._exceptions, self._index = exceptions, worker_idx
        with self._exceptions_sent():
            super().__init__(*args, process=worker_idx, worker_idx=worker_idx, **kwargs)

    def iterator(self) -> Iterator[TensorDictBase]:
        """See the base class."""
        with self._exceptions_sent():
            yield from super().iterator()

    def reset(self, *args: Any, **kwargs: Any) -> None:
        """See the base class."""
        with self._exceptions_sent():
            super().reset(*args, **kwargs)

    @contextmanager
    def _exceptions_sent(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            self._exceptions.put((self._index, message[:_MESSAGE_CHARS]))
            raise


class SupervisedCollector(MultiSyncCollector):
    """TorchRL's collector, which raises `WorkerError` as soon as one of its processes ends.

    Workers end by themselves when this process ends.

    Args:
        make_envs: As for `MultiSyncCollector`.
        policy: As for `MultiSyncCollector`.
        limit: Limit for the time that a worker takes to start, for a batch, a reset or new
            parameters.
        **kwargs: As for `MultiSyncCollector`.

    Attributes:
        group: The workers.

    Raises:
        WorkerError: If a worker ends before all are ready, or is not ready in time.
    """

    procs: Sequence[BaseProcess] = ()  # torchrl replaces it while it starts them
    queue_out: Any  # torchrl makes it

    def __init__(
        self,
        make_envs: Sequence[Callable[[], Any]],
        policy: Any,
        limit: Limit,
        **kwargs: Any,
    ) -> None:
        self._exceptions: SimpleQueue[tuple[int, str]] = multiprocessing.SimpleQueue()
        self.group = ProcessGroup("worker process", lambda: self.procs, limit, self._raised)
        self._weights = _SupervisedWeights()
        schemes = {}
        if isinstance(policy, nn.Module):
            # here, and not in the thread of torchrl that sends them to the workers: a second thread
            # that computes in parallel slows down every parallel loop of this one (libgomp no
            # longer waits actively if it knows of more threads than there are cores)
            policy.share_memory()
            schemes["policy"] = self._weights
        self.receive_interrupts = block_interrupts()
        try:
            super().__init__(
                make_envs,
                policy,
                init_fn=partial(prepare_child, os.getpid()),
                collector_class=partial(WorkerCollector, exceptions=self._exceptions),
                weight_sync_schemes=schemes,
                **kwargs,
            )
        except BaseException as error:
            self._weights.shutdown()
            if isinstance(error, Exception):  # an interrupt is no failure of a worker
                self._raise_worker_error(error)
            self.shutdown(raise_on_error=False)
            raise
        finally:
            self.receive_interrupts()
        self.queue_out = BatchQueue(self.queue_out, len(self.procs), self.group.time_limit())
        self.group.watch()

    @property
    def pipes(self) -> Sequence[AnswerPipe]:
        """The pipes to the workers; torchrl makes them, and waits for the first answers."""
        return self._pipes

    @pipes.setter
    def pipes(self, made: Sequence[Any]) -> None:
        self._pipes = [AnswerPipe(pipe, index, self.group) for index, pipe in enumerate(made)]

    def _raised(self) -> dict[int, str]:
        """Return the exceptions that workers have sent, by index."""
        raised: dict[int, str] = {}
        while not self._exceptions.empty():
            index, message = self._exceptions.get()
            raised.setdefault(index, message)
        return raised

    def iterator(self) -> Iterator[TensorDictBase]:
        """See `MultiSyncCollector`; raises `WorkerError` if a worker has ended."""
        with self._worker_errors():
            yield from super().iterator()

    def set_seed(self, seed: int, static_seed: bool = False) -> int:
        """See `MultiSyncCollector`; raises `WorkerError` if a worker has ended."""
        with self._worker_errors():
            return int(super().set_seed(seed, static_seed))

    def _recv_and_check(self, pipe: AnswerPipe, **options: Any) -> Any:
        """Return the next message of a worker, as the base class does, within the time limit."""
        if not torchrl_is_tested():
            return super()._recv_and_check(pipe, **options)
        return pipe.recv()

    def reset(self, reset_idx: Sequence[bool] | None = None) -> None:
        """See `MultiSyncCollector`; raises `WorkerError` if a worker has ended."""
        with self._worker_errors():
            super().reset(reset_idx)

    @contextmanager
    def _worker_errors(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            self._raise_worker_error(error)
            raise

    def _raise_worker_error(self, error: BaseException) -> None:
        """Raise `WorkerError` in place of `error` if a worker has ended."""
        if isinstance(error, WorkerError):  # of this collector, or of another group of processes
            return
        try:
            self.group.check()
        except WorkerError as found:
            raise found from error

    def shutdown(self, *args: Any, **kwargs: Any) -> None:
        """End the workers."""
        self.group.release()
        super().shutdown(*args, **kwargs)
        # otherwise done when it is collected as garbage: it may start a thread, which, when Python
        # ends, waits for ever
        self._weights.shutdown()


class _SupervisedWeights(SharedMemWeightSyncScheme):
    """TorchRL's transfer of parameters, which checks the workers while it waits for them."""

    def connect(self, **options: Any) -> None:
        """See the base class; it is called when all workers have been started, and in each."""
        if isinstance(self.context, SupervisedCollector):
            self.context.receive_interrupts()
        super().connect(**options)

    def _wait_for_ack(
        self, worker_ids: int | list[int] | None = None, timeout: float | None = None
    ) -> None:
        if not torchrl_is_tested():
            super()._wait_for_ack(worker_ids, timeout)
            return
        for index, queue in self._ack_queues.items():
            limit = self.context.group.time_limit()
            while not _received(queue):
                self.context.group.check()
                limit.check([index])


def _received(queue: Any) -> bool:
    try:
        queue.get(timeout=CHECK_S)
    except Empty:
        return False
    return True
