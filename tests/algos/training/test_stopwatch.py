import multiprocessing
import time

import pytest

from veca_marl.algos.training.schedule import Stopwatch, processor_seconds

BUSY_S = 0.3


def _compute(ready, go):
    while time.process_time() < BUSY_S:
        pass
    ready.set()
    go.wait()


def test_the_processor_time_of_children_counts_while_they_run_and_after():
    context = multiprocessing.get_context("fork")
    ready, go = context.Event(), context.Event()
    before = processor_seconds()
    child = context.Process(target=_compute, args=(ready, go))
    child.start()
    ready.wait()
    running = processor_seconds() - before
    go.set()
    child.join()
    ended = processor_seconds() - before
    assert running == pytest.approx(BUSY_S, abs=0.1)
    assert ended == pytest.approx(running, abs=0.1)


def test_times_of_batches_and_of_what_lies_between_them():
    elapsed, processor = iter([10.0, 12.0, 15.0, 19.0]), iter([1.0, 4.0, 9.0])
    watch = Stopwatch(lambda: next(elapsed), lambda: next(processor))
    watch.begin()
    first = watch.end(100)
    watch.begin()
    second = watch.end(100)
    assert first == {"frames_per_s": 50.0, "between_s": 0.0, "processor_s": 3.0}
    assert second == {"frames_per_s": 25.0, "between_s": 3.0, "processor_s": 5.0}
