"""The collector that runs in each worker process of a `SupervisedCollector`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tensordict import TensorDictBase
from torchrl.collectors import Collector

_MESSAGE_CHARS = 1000  # with a pickle's overhead below what a pipe writes at once (4096 bytes)


class WorkerCollector(Collector):
    """The collector in a worker; it sends an exception's message before the worker ends.

    Args:
        *args: As for `Collector`.
        exceptions: A queue for the index of the worker and the message.
        worker_idx: Index of the worker.
        **kwargs: As for `Collector`.
    """

    def __init__(self, *args: Any, exceptions: Any, worker_idx: int, **kwargs: Any) -> None:
        self._exceptions, self._index = exceptions, worker_idx
        with self._exceptions_sent():
            super().__init__(*args, worker_idx=worker_idx, **kwargs)

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
