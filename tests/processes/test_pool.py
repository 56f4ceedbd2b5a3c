"""Pools of processes, by small servers; evaluations and tools test them with real ones."""

import multiprocessing
import os
import signal
import sys
import time
from contextlib import closing
from threading import Timer

import pytest

from veca_marl.processes.pool import ProcessPool
from veca_marl.processes.supervision import Limit, WorkerError


def make_adder(_):
    """A server with a state: it counts the requests that it has served."""
    served = []

    def serve(request):
        served.append(request)
        return os.getpid(), request + 1, len(served)

    return serve


def test_each_request_is_answered_once_by_processes_that_keep_their_state():
    with closing(ProcessPool("adding process", make_adder, 2)) as pool:
        for requests in (range(10, 17), [], [3]):
            answers = dict(pool.answers(requests))
            assert {n: answer[1] for n, answer in answers.items()} == {
                n: request + 1 for n, request in enumerate(requests)
            }
            by_process = {}
            for process, _, served in answers.values():
                by_process.setdefault(process, []).append(served)
            assert len(by_process) <= 2
            assert all(len(set(counts)) == len(counts) for counts in by_process.values())
    assert not multiprocessing.active_children()


def make_patient(count_progress):
    """A server of two requests: progress for 3 s, or silence for ever."""

    def serve(makes_progress):
        for _ in range(30 if makes_progress else 6000):
            time.sleep(0.1)
            if makes_progress:
                count_progress()
        return "done"

    return serve


@pytest.mark.slow
def test_only_a_process_without_progress_is_silent():
    limit = Limit(1.5, "group.limit_s")
    with closing(ProcessPool("patient process", make_patient, 2, limit, "fork")) as pool:
        assert dict(pool.answers([True, True])) == {0: "done", 1: "done"}
        with pytest.raises(WorkerError, match=r"patient process 1 .*1\.5 s \(group\.limit_s\)"):
            list(pool.answers([True, False]))
    assert not multiprocessing.active_children()


class OwnError(Exception):
    """An exception that cannot be unpickled."""

    def __init__(self, number, unit):
        super().__init__(f"{number} {unit}")


def make_failing(_):
    def serve(request):
        if request == "raise":
            raise OwnError(3, "m")
        if request == "end of a file":
            raise EOFError("no more lines")
        return lambda: None  # cannot be pickled

    return serve


def answer_all(pool, *requests):
    return dict(pool.answers(requests))


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ("raise", "failing process 0 .*: OwnError: 3 m"),
        ("end of a file", "failing process 0 .*: EOFError: no more lines"),
        ("answer", "failing process 0 "),
    ],
)
def test_a_process_that_fails_is_named_and_all_are_ended(request_, message):
    with closing(ProcessPool("failing process", make_failing, 2, method="fork")) as pool:
        with pytest.raises(WorkerError, match=message) as found:
            answer_all(pool, request_)
        if request_ == "raise":
            assert "in serve" in found.value.__notes__[0], "the traceback is lost"
        with pytest.raises(WorkerError, match=message):
            answer_all(pool, "again")
    assert not multiprocessing.active_children()


def make_none(_):
    raise ValueError("no server")


def test_a_server_that_cannot_be_made_is_named():
    pool = ProcessPool("failing process", make_none, 1, method="fork")
    with closing(pool), pytest.raises(WorkerError, match="ValueError: no server"):
        answer_all(pool, 1)


def test_processes_that_cannot_be_started_leave_none_behind():
    with pytest.raises((AttributeError, TypeError), match=r"pickle|local"):
        ProcessPool("process", lambda _: None, 2)
    assert not multiprocessing.active_children()


def make_idle(_):
    return time.sleep


@pytest.fixture
def terminating():
    """SIGTERM raises `KeyboardInterrupt` in this process, as in the commands."""
    former = signal.signal(signal.SIGTERM, signal.default_int_handler)
    yield
    signal.signal(signal.SIGTERM, former)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM of other processes")
@pytest.mark.usefixtures("terminating")
@pytest.mark.parametrize("wait", [lambda pool: answer_all(pool, 60.0), lambda _: time.sleep(60.0)])
def test_a_request_to_end_that_reaches_the_workers_first_is_no_failure_of_them(wait):
    """A job is ended by SIGTERM to all of its processes, in any order."""
    with closing(ProcessPool("idle process", make_idle, 2, method="fork")) as pool:
        end_this = Timer(0.3, os.kill, (os.getpid(), signal.SIGTERM))
        end_this.start()
        try:
            with pytest.raises(KeyboardInterrupt):
                end_all_and(wait, pool)
        finally:
            end_this.cancel()
            end_this.join()
    assert not multiprocessing.active_children()


def end_all_and(wait, pool):
    end(multiprocessing.active_children())
    wait(pool)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM of other processes")
@pytest.mark.usefixtures("terminating")
def test_workers_that_end_while_this_process_ends_are_no_failure():
    handler = signal.getsignal(signal.SIGINT)
    pool = ProcessPool("idle process", make_idle, 2, method="fork")
    with closing(pool), pytest.raises(KeyboardInterrupt):
        end_this_before_its_workers(pool)
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler


def end_this_before_its_workers(pool):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        answer_all(pool, 60.0)
    finally:
        children = multiprocessing.active_children()
        end(children)
        for child in children:
            child.join(30.0)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM of other processes")
def test_a_worker_that_is_asked_to_end_by_itself_is_named():
    pool = ProcessPool("idle process", make_idle, 2, method="fork")
    with closing(pool), pytest.raises(WorkerError, match=r"idle process 1 .*SIGTERM"):
        end_one_and_wait(pool)


def end_one_and_wait(pool):
    end(pool._group._processes()[1:])
    time.sleep(60.0)


def end(processes):
    """Send SIGTERM to processes."""
    for process in processes:
        os.kill(process.pid, signal.SIGTERM)
