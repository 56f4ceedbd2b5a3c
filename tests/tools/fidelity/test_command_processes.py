"""Processes of the command `python -m tools.fidelity`."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from paths import ROOT


def children(pid):
    return [int(n) for n in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def wait_until(holds, seconds):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"not within {seconds} s"
        time.sleep(0.1)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_workers_end_with_a_command_that_is_killed(tmp_path):
    words = ["sections=[doppler,near_field]", "processes=2", f"to={tmp_path}"]
    command = subprocess.Popen([sys.executable, "-m", "tools.fidelity", *words], cwd=ROOT)
    wait_until(lambda: len(children(command.pid)) >= 3, 60)  # a resource tracker and two workers
    workers = children(command.pid)
    time.sleep(3.0)
    os.kill(command.pid, signal.SIGKILL)
    command.wait()
    # one that still imports its modules sees the end of its parent after that
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 60)
    assert len(workers) == 3
