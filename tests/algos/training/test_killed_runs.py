"""A run that is killed and continued stores the same as a run that is not interrupted."""

import multiprocessing
import os
import time
from functools import partial

import numpy as np
import pytest
from killed_runs import Child, assert_equal, die, make_trainer, stored
from training import FRAMES

from veca_marl.algos import files
from veca_marl.algos.reporting import MemoryReporter
from veca_marl.processes.supervision import WorkerError


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("killed") / "whole"
    begin = time.monotonic()
    assert Child(folder).wait() == 0
    return stored(folder), time.monotonic() - begin


def die_at_call(count, function):
    """Return a function that ends the process at its `count`-th call, before it does anything."""
    calls = iter(range(1, 1_000_000))

    def called(*arguments):
        if next(calls) == count:
            die()
        return function(*arguments)

    return called


def die_while_a_file_is_replaced(count):
    files.os = type("os", (), vars(os) | {"replace": die_at_call(count, os.replace)})


def die_while_a_file_is_written(count):
    """The content is in a buffer then: nothing of it or a part has reached the file."""
    files.os = type("os", (), vars(os) | {"fsync": die_at_call(count, os.fsync)})


# files are written in this order: frames_0, [best, frames_128], [best, frames_256], ...
MOMENTS = {
    "before the first checkpoint": partial(die_while_a_file_is_replaced, 1),
    "between best.pt and the checkpoint": partial(die_while_a_file_is_replaced, 3),
    "while a checkpoint is written": partial(die_while_a_file_is_written, 8),
}


@pytest.mark.slow
@pytest.mark.parametrize("prepare", MOMENTS.values(), ids=MOMENTS)
def test_a_run_killed_while_files_are_written_stores_the_same(whole, tmp_path, prepare):
    assert Child(tmp_path / "run", prepare).wait() == -9
    assert Child(tmp_path / "run").wait() == 0
    assert_equal(stored(tmp_path / "run"), whole[0])


@pytest.mark.slow
def test_a_run_killed_at_random_moments_stores_the_same(whole, tmp_path):
    rng = np.random.default_rng(0)
    for _ in range(2):
        Child(tmp_path / "run").kill_after(rng.uniform(0.3, 1.0) * whole[1])
    assert Child(tmp_path / "run").wait() == 0
    assert_equal(stored(tmp_path / "run"), whole[0])


class KillAWorker(MemoryReporter):
    """A reporter that kills a worker process after some frames."""

    def __init__(self, frames):
        self.frames = frames

    def write(self, kind, frames, row):
        if frames == self.frames:
            multiprocessing.active_children()[0].kill()

    def sync(self):
        pass

    def close(self):
        pass


def test_a_run_that_loses_a_worker_keeps_its_checkpoint(tmp_path):
    trainer = make_trainer(tmp_path, processes=2)
    trainer.reporters.append(KillAWorker(3 * FRAMES))
    with pytest.raises(WorkerError, match=r"process \d .*SIGKILL"):
        trainer.run()
    assert not multiprocessing.active_children()
    assert trainer.checkpoints.latest().name == f"frames_{2 * FRAMES:012d}.pt"
    assert make_trainer(tmp_path, processes=2).progress.frames == 2 * FRAMES


@pytest.mark.slow
@pytest.mark.parametrize("processes", [0, 2], ids=["in_process", "two_processes"])
def test_20_kills_at_random_moments_leave_no_trace(tmp_path, processes):
    begin = time.monotonic()
    assert Child(tmp_path / "whole", processes=processes).wait() == 0
    duration = time.monotonic() - begin
    whole, rng = stored(tmp_path / "whole"), np.random.default_rng(1)
    for run in range(10):
        folder = tmp_path / str(run)
        for _ in range(2):
            Child(folder, processes=processes).kill_after(rng.uniform(0.0, 1.0) * duration)
        assert Child(folder, processes=processes).wait() == 0
        assert_equal(stored(folder), whole)
