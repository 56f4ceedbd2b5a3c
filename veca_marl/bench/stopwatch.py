"""A stopwatch for nested parts of a computation; their times sum to the total."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from statistics import median
from typing import Any

Clock = Callable[[], int]


class Stopwatch:
    """Exclusive time of each part: the time of nested parts is not counted again.

    The default clock is the processor time of the calling thread, which depends less on the load
    of the machine than elapsed time. The time of reading the clock is subtracted.

    Args:
        rest: The part that is counted while no wrapped part runs.
        clock: Monotonic clock in nanoseconds.

    Attributes:
        nanoseconds: Time by part.
    """

    def __init__(self, rest: str, clock: Clock = time.thread_time_ns) -> None:
        self.nanoseconds: defaultdict[str, int] = defaultdict(int)
        self._clock = clock
        self._rest = rest
        self._part: str | None = None
        self._since = 0
        self._reading_ns = _reading_ns(clock)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count time inside the with statement; outside, wrapped calls are not timed."""
        self._part, self._since = self._rest, self._clock()
        try:
            yield
        finally:
            self._switch(None)

    def wrap(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return `call` with its time counted as `part` while the stopwatch runs."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            if self._part is None:
                return call(*args, **kwargs)
            outer = self._switch(part)
            try:
                return call(*args, **kwargs)
            finally:
                self._switch(outer)

        return timed

    def _switch(self, part: str | None) -> str | None:
        now = self._clock()
        previous = self._part
        if previous is not None:
            self.nanoseconds[previous] += now - self._since - self._reading_ns
        self._part, self._since = part, now
        return previous


class Probes(ExitStack):
    """Replaces methods of objects by timed ones for the duration of a with statement.

    Args:
        watch: The stopwatch that counts.
    """

    def __init__(self, watch: Stopwatch) -> None:
        super().__init__()
        self._watch = watch

    def put(self, part: str, owner: Any, *methods: str) -> None:
        """Count the time of methods of one object as `part`."""
        for method in methods:
            setattr(owner, method, self._watch.wrap(part, getattr(owner, method)))
            self.callback(delattr, owner, method)


def _reading_ns(clock: Clock) -> int:
    readings = [clock() for _ in range(1000)]
    return int(median(later - earlier for earlier, later in pairwise(readings)))


def thread_ms(call: Callable[[], object]) -> float:
    """Return the milliseconds of processor time that a call takes this thread."""
    start = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - start)
