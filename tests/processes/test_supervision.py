"""Messages about processes that have ended or do not answer, and their ends."""

import signal
import subprocess
import sys
import time
from multiprocessing import get_context

import pytest
from refusals import naming

from veca_marl.processes.children import end_all, end_of
from veca_marl.processes.supervision import Limit, ProcessGroup, WorkerError


@pytest.mark.parametrize(
    ("silent", "name"),
    [
        ([1], "worker process 1 "),
        ([0, 2], "worker processes 0 and 2 "),
    ],
)
def test_the_message_agrees_in_number(silent, name):
    processes = [get_context("spawn").Process() for _ in range(3)]
    group = ProcessGroup("worker process", lambda: processes, Limit(2.0, "limit_s"))
    with pytest.raises(WorkerError, match=naming(name, "0 to 2", " 2 s ", "limit_s")):
        group.abandon(silent)


def test_an_end_is_described_by_its_code_or_its_signal():
    assert "3" in end_of(3)
    assert "SIGTERM" in end_of(-signal.SIGTERM)
    assert "memory" in end_of(-signal.SIGKILL)
    assert "99" in end_of(-99)


DEAF = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True);"


def sleep_until_terminated(ready):
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # whatever this process had installed
    ready.set()
    time.sleep(60)


@pytest.mark.slow
def test_processes_that_ignore_the_request_to_end_are_killed_after_a_common_grace():
    commands = [
        subprocess.Popen([sys.executable, "-S", "-c", f"{code} time.sleep(60)"], stdout=-1)
        for code in (DEAF, DEAF, "import time; print(flush=True);")
    ]
    for command in commands:
        command.stdout.readline()
    context = get_context("fork")
    ready = context.Event()
    child = context.Process(target=sleep_until_terminated, args=(ready,))
    child.start()
    assert ready.wait(60.0)
    begin = time.monotonic()
    end_all([*commands, child], 4.0)
    assert 4.0 <= time.monotonic() - begin < 7.8
    assert [command.returncode for command in commands] == [-9, -9, -15]
    assert child.exitcode == -15
    for command in commands:
        command.stdout.close()
