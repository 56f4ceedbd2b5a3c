"""Nothing is written through links in the folder of a run, which may be of unknown origin."""

import os
from pathlib import Path

import pytest
from commands import train
from refusals import naming

from veca_marl import api
from veca_marl.config import ConfigError
from veca_marl.runs.lock import LOCK, check_links, locked
from veca_marl.runs.run_folder import new_run, writable_run

IN_RUNS = (
    LOCK,
    "config.yaml",
    "progress.json",
    "provenance.json",
    "metrics.csv",
    "checkpoints",
    "checkpoints/best.pt",
    "tensorboard",
    "pool",
    "videos/final.mp4",
    "videos/episode.html",
    "wandb",
    "notes.txt",
)
BY_LOGGERS = {"wandb/latest": "run-1", "wandb/log": "run-1/log"}


@pytest.fixture
def own(tmp_path):
    """A folder of the user's with a file."""
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "thesis.txt").write_text("own")
    return folder


@pytest.fixture
def run(tmp_path):
    """A folder with the files that tell that it is a run."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "config.yaml").write_text("task: {name: KickTheBall}\n")
    return folder


def link(path, target):
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    path.symlink_to(target)


def content(folder):
    return {path: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}


TO_A_FILE = [(name, "thesis.txt") for name in IN_RUNS]
TO_A_FOLDER = [(name, ".") for name in ("checkpoints", "pool", "wandb", LOCK)]


@pytest.mark.parametrize(("name", "target"), TO_A_FILE + TO_A_FOLDER)
def test_a_run_with_a_link_is_not_written_to(own, run, name, target):
    link(run / name, own / target)
    with pytest.raises(ConfigError, match=naming(run / name)):
        writable_run(run, "resume=")


@pytest.mark.parametrize("name", [LOCK, "config.yaml", "checkpoints"])
def test_a_run_with_a_link_is_neither_resumed_nor_locked(tmp_path, own, run, capsys, name):
    link(run / name, own / "thesis.txt")
    before, of_run = content(own), sorted(run.rglob("*"))
    assert train(tmp_path, f"resume={run}") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(run / name) in line
    assert (content(own), sorted(run.rglob("*"))) == (before, of_run)


@pytest.mark.parametrize("name", ["metrics.csv", "checkpoints", "tensorboard", "videos"])
def test_a_new_run_does_not_write_through_a_link(own, tmp_path, name):
    link(tmp_path / "new" / name, own)
    before = content(own)
    with pytest.raises(ConfigError, match=naming(tmp_path / "new" / name)):
        api.train("KickTheBall", folder=tmp_path / "new")
    assert content(own) == before
    assert os.listdir(tmp_path / "new") == [name]


@pytest.mark.parametrize("name", ["metrics.csv", "checkpoints/frames_000000000008.pt"])
def test_a_new_run_overwrites_nothing(tmp_path, name):
    path = tmp_path / "new" / name
    path.parent.mkdir(parents=True)
    path.write_text("own")
    with pytest.raises(ConfigError, match=naming(tmp_path / "new" / name.partition("/")[0])):
        new_run(tmp_path / "new")


def test_links_of_loggers_and_of_the_user_are_allowed(own, run):
    for name, target in BY_LOGGERS.items():
        link(run / name, target)
    (run.parent / "latest").symlink_to(run)
    writable_run(run.parent / "latest", "resume=")
    link(run / "wandb" / "latest", own)
    with pytest.raises(ConfigError, match=naming(run / "wandb" / "latest")):
        check_links(run)
    new = run.parent / "new"
    link(new / "data", own)
    assert new_run(new).path == new


@pytest.mark.parametrize("kind", ["link", "second name", "own file", "pipe"])
def test_what_is_no_lock_is_neither_written_nor_removed(tmp_path, own, kind):
    path, thesis = tmp_path / "new" / LOCK, own / "thesis.txt"
    path.parent.mkdir()
    make = {
        "link": lambda: path.symlink_to(thesis),
        "second name": lambda: path.hardlink_to(thesis),
        "own file": lambda: path.write_text("pid 3"),
        "pipe": lambda: os.mkfifo(path),
    }
    make[kind]()
    with pytest.raises((ConfigError, RuntimeError), match=naming(path)), locked(path.parent):
        pass
    assert thesis.read_text() == "own"
    assert path.exists()
    assert kind != "own file" or path.read_text() == "pid 3"


def test_the_folder_of_no_run_gets_no_lock(tmp_path, own, capsys):
    for folder in (own, tmp_path / "absent"):
        assert train(tmp_path, f"resume={folder}") == 2
        assert str(folder) in capsys.readouterr().err
    assert [path.name for path in own.iterdir()] == ["thesis.txt"]
    assert not (tmp_path / "absent").exists()
