"""A stopwatch whose parts always sum up to the total."""

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
    """Time by part, each moment counted once: a part does not contain the parts inside it.

    It counts processor time of the calling thread by default, so that a busy machine changes the
    numbers less than wall time would. What looking at the clock costs is taken off.

    Args:
        rest: The part that counts while no other does.
        clock: Nanoseconds, never falling.

    Attributes:
        nanoseconds: Time by part.
    """

    def __init__(self, rest: str, clock: Clock = time.thread_time_ns) -> None:
        self.nanoseconds: defaultdict[str, int] = defaultdict(int)
        self._clock = clock
        self._rest = rest
        self._part: str | None = None
        self._since = 0
        self._look_ns = _cost_of_looking(clock)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count; what is wrapped costs no more than its call outside of this."""
        self._part, self._since = self._rest, self._clock()
        try:
            yield
        finally:
            self._switch(None)

    def wrap(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return `call`, its time counted as `part` while the watch runs."""

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
            self.nanoseconds[previous] += now - self._since - self._look_ns
        self._part, self._since = part, now
        return previous


class Probes(ExitStack):
    """Wraps methods of objects from outside, and takes the wrappers off again at the end.

    Args:
        watch: What counts.
    """

    def __init__(self, watch: Stopwatch) -> None:
        super().__init__()
        self._watch = watch

    def put(self, part: str, owner: Any, *methods: str) -> None:
        """Count the methods of one object as `part`."""
        for method in methods:
            setattr(owner, method, self._watch.wrap(part, getattr(owner, method)))
            self.callback(delattr, owner, method)


def _cost_of_looking(clock: Clock) -> int:
    looks = [clock() for _ in range(1000)]
    return int(median(later - look for look, later in pairwise(looks)))


def thread_ms(call: Callable[[], object]) -> float:
    """Return the milliseconds of processor time that a call takes this thread."""
    start = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - start)
