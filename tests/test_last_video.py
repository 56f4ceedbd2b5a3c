"""The video of a run is recorded beside its last evaluation; its errors are raised afterwards."""

from types import SimpleNamespace

import pytest

from veca_marl.processes.supervision import WorkerError
from veca_marl.runs import training
from veca_marl.runs.training import LastVideo

TRAINER = SimpleNamespace(policy=SimpleNamespace(play="policy"), evaluation_seed=3)


def video(monkeypatch, record):
    monkeypatch.setattr(training, "record_episode", record)
    return LastVideo("final.mp4", "game", TRAINER, "episode.html")


def test_the_first_episode_of_the_evaluation_is_recorded(monkeypatch):
    recorded = []
    made = video(monkeypatch, lambda *arguments: recorded.append(arguments))
    made.record()
    made.check()
    assert recorded == [("final.mp4", "game", "policy", 3, "episode.html")]


def test_an_error_is_raised_when_the_run_has_stored_its_checkpoint(monkeypatch):
    def fail(*arguments):
        raise OSError("no space left")

    made = video(monkeypatch, fail)
    made.record()
    with pytest.raises(OSError, match="no space left"):
        made.check()


def test_the_end_of_an_evaluation_process_ends_the_recording(monkeypatch):
    def end(*arguments):
        raise WorkerError("evaluation process 0 was killed")

    with pytest.raises(WorkerError):
        video(monkeypatch, end).record()
