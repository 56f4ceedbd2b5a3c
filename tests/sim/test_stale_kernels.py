"""Kernels are compiled anew when what they call has changed."""

import subprocess
import sys

import pytest

from veca_marl.sim.stale_kernels import forget_stale_kernels

CALLED = "from numba import njit\n@njit(cache=True)\ndef called():\n    return {}\n"
CALLER = (
    "from numba import njit\nfrom called import called\n"
    "@njit(cache=True)\ndef caller():\n    return called()\n"
)


def call(folder):
    program = [sys.executable, "-c", "from caller import caller; print(caller())"]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=True)
    return int(done.stdout)


def kernels(folder):
    return {path.name for path in folder.rglob("*.nb?")}


@pytest.fixture
def sources(tmp_path):
    """Two kernels, one of which calls the other, compiled."""
    (tmp_path / "called.py").write_text(CALLED.format(1))
    (tmp_path / "caller.py").write_text(CALLER)
    forget_stale_kernels(tmp_path)
    assert call(tmp_path) == 1
    assert kernels(tmp_path)
    return tmp_path


def test_a_change_in_what_is_called_reaches_the_caller(sources):
    (sources / "called.py").write_text(CALLED.format(2))
    assert call(sources) == 1, "numba notices it by itself now: stale_kernels.py can go"
    forget_stale_kernels(sources)
    assert call(sources) == 2


def test_kernels_stay_while_no_source_changes(sources):
    before = kernels(sources)
    forget_stale_kernels(sources)
    assert kernels(sources) == before


def test_a_source_that_came_or_went_is_a_change(sources):
    (sources / "new.py").touch()
    forget_stale_kernels(sources)
    assert not kernels(sources)


def test_a_folder_that_cannot_be_written_is_left_alone(sources, monkeypatch):
    (sources / "new.py").touch()
    monkeypatch.setattr("os.access", lambda path, mode: False)
    forget_stale_kernels(sources)
    assert kernels(sources)
