"""One process at a time trains in the folder of a run."""

import errno
import os
import subprocess
import sys

import pytest
from commands import train
from hydra.core.utils import setup_globals
from omegaconf import OmegaConf
from refusals import naming

from veca_marl import api
from veca_marl.config import ConfigError
from veca_marl.plugins import conf_dir
from veca_marl.runs import lock
from veca_marl.runs.lock import locked

SMOKE = ["+experiment=smoke", "senses/vision=blind", "log=silent", "threads=1", "total_frames=64"]
HOLDER = """
import sys
import time
from pathlib import Path

from veca_marl.runs.lock import locked

with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600.0)
"""


@pytest.fixture(autouse=True)
def short_wait(monkeypatch):
    monkeypatch.setattr(lock, "_WAIT_S", 0.3)


@pytest.fixture
def holder(tmp_path):
    """A process that holds the lock on the folder `run`."""
    words = [sys.executable, "-c", HOLDER, str(tmp_path / "run")]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.mark.slow
def test_a_folder_that_another_process_holds_is_refused_until_that_is_killed(tmp_path, holder):
    parts = (tmp_path / "run", holder.pid)
    with pytest.raises(ConfigError, match=naming(*parts)), locked(tmp_path / "run"):
        pass
    holder.kill()
    holder.wait()
    with locked(tmp_path / "run"):
        pass


def test_the_lock_leaves_neither_a_file_nor_an_empty_folder(tmp_path):
    with locked(tmp_path / "new" / "run"):
        assert (tmp_path / "new" / "run").is_dir()
    assert not (tmp_path / "new" / "run").exists()
    (tmp_path / "config.yaml").touch()
    with pytest.raises(KeyError), locked(tmp_path):
        raise KeyError
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["config.yaml"]


def test_a_lock_whose_file_was_removed_in_the_meantime_does_not_count(tmp_path, monkeypatch):
    """A run that ends removes the file; another one may have opened it just before."""
    flock, calls = lock.fcntl.flock, []

    def removed_before_the_first_call(file, operation):
        if not calls:
            os.unlink(file.name)
        calls.append(file.name)
        flock(file, operation)

    monkeypatch.setattr(lock.fcntl, "flock", removed_before_the_first_call)
    with locked(tmp_path / "run"):
        assert len(calls) == 2
        assert (tmp_path / "run" / ".lock").exists()


def test_a_file_system_without_locks_is_reported(tmp_path, monkeypatch, caplog):
    def refuse(file, operation):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(lock.fcntl, "flock", refuse)
    with locked(tmp_path / "run"):
        assert "cannot be locked: start no other run in its folder" in caplog.text


@pytest.mark.slow
def test_a_new_run_in_the_folder_of_one_that_starts_is_refused(tmp_path, capsys):
    with locked(tmp_path / "run"):
        assert train(tmp_path, *SMOKE, f"hydra.run.dir={tmp_path / 'run'}") == 2
        with pytest.raises(ConfigError, match=naming(tmp_path / "run", os.getpid())):
            api.train("KickTheBall", folder=tmp_path / "run")
        assert [path.name for path in (tmp_path / "run").iterdir()] == [".lock"]
    error = capsys.readouterr().err
    assert all(part in error for part in (str(tmp_path / "run"), str(os.getpid())))


@pytest.mark.slow
def test_a_run_is_resumed_once_at_a_time(tmp_path, capsys):
    run = tmp_path / "run"
    assert train(tmp_path, *SMOKE, f"hydra.run.dir={run}") == 0
    assert not (run / ".lock").exists()
    before = (run / "provenance.json").read_bytes()
    with locked(run):
        assert train(tmp_path, f"resume={run}", "total_frames=128") == 2
    error = capsys.readouterr().err
    assert all(part in error for part in (str(run), str(os.getpid())))
    assert (run / "provenance.json").read_bytes() == before
    assert train(tmp_path, f"resume={run}", "total_frames=128") == 0


def test_runs_that_start_in_the_same_second_have_two_folders_in_the_order_of_time():
    setup_globals()
    hydra = OmegaConf.load(conf_dir() / "config.yaml").hydra

    def name():
        choices = {"runtime": {"choices": {"task": "KickTheBall"}}}
        node = OmegaConf.create({"resume": None, "hydra": {"run": hydra.run, **choices}})
        return node.hydra.run.dir

    names = [name() for _ in range(3)]
    assert len({*names}) == 3
    assert names == sorted(names)
