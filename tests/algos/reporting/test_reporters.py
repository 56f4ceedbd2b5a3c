import csv
import errno
import math
import os
import resource
import shutil
from io import BytesIO

import numpy as np
import pytest
import torch
from fake_env import FakeEnv
from PIL import Image
from refusals import naming
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensordict import TensorDict
from torchrl import timeit

from veca_marl.algos.evaluation.episodes import TrainingEpisodes
from veca_marl.algos.files import WriteError
from veca_marl.algos.reporting import (
    CsvReporter,
    LoggerKind,
    LoggerReporter,
    check_installed,
    make_reporter,
)
from veca_marl.algos.training.schedule import timing_table
from veca_marl.runs.video import animated_gif, write_video


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_episodes_are_summed_across_batches():
    """Batches of any length give the same episodes."""
    play = FakeEnv(3, horizon=7).rollout(42, break_when_any_done=False)
    whole = TrainingEpisodes().add(play, "agents")
    in_pieces = TrainingEpisodes()
    found, ended, last = 0.0, 0, math.nan
    for piece in play.split([5, 1, 20, 4, 12], dim=1):
        means = in_pieces.add(piece, "agents")
        assert means["episodes"] == int(piece["next", "done"].sum())
        found += means["return"] * means["episodes"] if means["episodes"] else 0.0
        ended += int(means["episodes"])
        if not means["episodes"]:  # as in the last batch in which an episode ended, if there is one
            assert means["return"] == pytest.approx(last, nan_ok=True)
        last = means["return"]
    assert ended == 3 * 6
    assert found / ended == pytest.approx(whole["return"])
    assert whole["length"] == 7
    assert whole["right"] == pytest.approx(whole["return"])
    assert whole["reward_per_step"] == pytest.approx(whole["return"] / 7)


def test_returns_are_means_over_the_agents_of_a_team():
    step = TensorDict({"agents": {"reward": torch.tensor([[[[1.0], [3.0]]]])}}, (1, 1))
    step["done"] = torch.ones(1, 1, 1, dtype=torch.bool)
    means = TrainingEpisodes().add(TensorDict({"next": step}, (1, 1)), "agents")
    assert means["return"] == 2.0
    assert (means["return/0"], means["return/1"]) == (1.0, 3.0)


def test_csv_has_one_row_per_write_and_blanks_for_nan(tmp_path):
    reporter = CsvReporter(tmp_path)
    reporter.write("metrics", 10, {"a/return": math.nan, "a/kl": 0.25})
    reporter.write("metrics", 20, {"a/return": 1.5, "a/kl": 1e-9})
    assert rows_of(tmp_path / "metrics.csv") == [
        {"frames": "10", "a/return": "", "a/kl": "0.25"},
        {"frames": "20", "a/return": "1.5", "a/kl": "1e-09"},
    ]


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_csv_has_numbers_under_their_names_in_whatever_order_they_come(tmp_path):
    reporter = CsvReporter(tmp_path)
    reporter.write("metrics", 10, {"x": 1, "y": 2})
    reporter.write("metrics", 20, {"y": 2, "x": 1})
    rows = read(tmp_path / "metrics.csv")
    assert [(row["x"], row["y"]) for row in rows] == [("1", "2")] * 2


def test_a_number_that_earlier_rows_do_not_have_becomes_a_column(tmp_path):
    CsvReporter(tmp_path).write("metrics", 10, {"x": 1})
    resumed = CsvReporter(tmp_path, resumed_frames=10)
    resumed.write("metrics", 20, {"seconds": 3, "x": 2})
    resumed.write("metrics", 30, {"x": 4})
    rows = [tuple(row.values()) for row in read(tmp_path / "metrics.csv")]
    assert rows == [("10", "1", ""), ("20", "2", "3"), ("30", "4", "")]
    assert list(read(tmp_path / "metrics.csv")[0]) == ["frames", "x", "seconds"]


def test_a_row_that_was_cut_off_is_dropped(tmp_path):
    """'frames' of the cut row reads 3, which is a smaller number than that of the checkpoint."""
    path = tmp_path / "metrics.csv"
    path.write_text("frames,a/return\n10,1.5\n20,2.5\n3")
    CsvReporter(tmp_path, resumed_frames=20).write("metrics", 30, {"a/return": 3.5})
    assert [row["frames"] for row in rows_of(path)] == ["10", "20", "30"]
    assert rows_of(path)[-1]["a/return"] == "3.5"


@pytest.mark.parametrize("text", ["", "fra", "frames,a/ret", "frames,a/return\n"])
def test_a_header_that_was_cut_off_is_written_again(tmp_path, text):
    path = tmp_path / "metrics.csv"
    path.write_text(text)
    CsvReporter(tmp_path, resumed_frames=0).write("metrics", 10, {"a/return": 1.5})
    assert rows_of(path) == [{"frames": "10", "a/return": "1.5"}]


@pytest.mark.parametrize(
    "text",
    [
        "10,1.5\n20,2.5\n",
        "frames,a/return\nx,1.5\n",
        "frames,a/ret",
        "",
        f"frames,a/return\n10,{'1' * 2**18}\n",
    ],
)
def test_a_damaged_table_is_named_and_kept(tmp_path, text):
    path = tmp_path / "metrics.csv"
    path.write_text(text)
    with pytest.raises(WriteError, match=naming(path)):
        CsvReporter(tmp_path, resumed_frames=20)
    assert path.read_text() == text


def test_a_table_that_is_damaged_during_a_run_is_named(tmp_path):
    path = tmp_path / "metrics.csv"
    reporter = CsvReporter(tmp_path)
    reporter.write("metrics", 10, {"a/return": 1.5})
    with path.open("a") as table:
        table.write("20,1.5,2.5\n")
    with pytest.raises(WriteError, match=naming(path)):
        reporter.write("metrics", 30, {"a/return": 1.5, "a/new": 0.5})


@pytest.mark.parametrize("resumed", [False, True])
@pytest.mark.parametrize("harm", ["delete", "empty", "cut"])
@pytest.mark.parametrize("noticed", ["write", "sync", "close"])
def test_rows_of_a_table_that_is_lost_during_a_run_are_written_again(
    tmp_path, resumed, harm, noticed, caplog
):
    whole, lost = tmp_path / "whole", tmp_path / "lost"
    for folder in (whole, lost):
        folder.mkdir()
        path = folder / "metrics.csv"
        reporter = CsvReporter(folder)
        reporter.write("metrics", 10, {"a/return": 1.5})
        reporter.write("metrics", 20, {"a/return": math.nan, "a/kl": 0.25})
        if resumed:
            reporter = CsvReporter(folder, 20)
        if folder is lost and harm == "delete":
            path.unlink()
        elif folder is lost:
            os.truncate(path, 0 if harm == "empty" else path.stat().st_size - 3)
        if noticed == "write":
            reporter.write("metrics", 30, {"a/kl": 0.5, "a/loss": 1.0})
        getattr(reporter, "sync" if noticed == "sync" else "close")()
    assert (lost / "metrics.csv").read_bytes() == (whole / "metrics.csv").read_bytes()
    assert [str(lost / "metrics.csv") in record.getMessage() for record in caplog.records] == [True]


def test_a_deleted_folder_is_not_made_again(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    reporter = CsvReporter(folder)
    reporter.write("metrics", 10, {"a/return": 1.5})
    shutil.rmtree(folder)
    with pytest.raises(WriteError, match=r"metrics\.csv"):
        reporter.write("metrics", 20, {"a/return": 1.5})
    assert not folder.exists()


def test_tables_of_other_commands_are_left_alone(tmp_path):
    other = tmp_path / "cross_play.csv"
    other.write_text("red_frames,blue_frames\n10,10\n")
    CsvReporter(tmp_path, resumed_frames=20)
    assert other.read_text() == "red_frames,blue_frames\n10,10\n"


def test_a_full_disk_is_reported_with_the_file_and_the_space(tmp_path):
    reporter = CsvReporter(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
    try:
        with pytest.raises(WriteError, match=naming(tmp_path / "metrics.csv", "MB")):
            reporter.write("metrics", 10, {"a/return": 1.5})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_resumed_csv_drops_later_rows(tmp_path):
    first = CsvReporter(tmp_path)
    for frames in (10, 20, 30):
        first.write("metrics", frames, {"x": frames})
    CsvReporter(tmp_path, resumed_frames=20).write("metrics", 30, {"x": 7})
    assert [row["x"] for row in rows_of(tmp_path / "metrics.csv")] == ["10", "20", "7"]


def test_tensorboard_gets_every_finite_number(tmp_path):
    reporter = make_reporter(LoggerKind.tensorboard, tmp_path, "run")
    reporter.write("evaluations", 10, {"team": "red", "return": 2.5, "length": math.nan})
    reporter.close()
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    assert events.Tags()["scalars"] == ["evaluations/red/return"]
    (point,) = events.Scalars("evaluations/red/return")
    assert (point.step, point.value) == (10, 2.5)


class FullLogger:
    def log_scalar(self, name, value, step):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def close(self):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_whole_numbers_keep_all_their_digits(tmp_path):
    """The frames of a past opponent are a float: they may be blank."""
    reporter = CsvReporter(tmp_path)
    reporter.write("metrics", 2_461_696, {"opponent_frames": 2461696.0, "x": 1.23456789})
    last = (tmp_path / "metrics.csv").read_text().splitlines()[-1]
    assert last == "2461696,2461696,1.23457"


def test_a_full_disk_under_a_logger_is_reported_with_the_folder_and_the_space(tmp_path):
    reporter = LoggerReporter(FullLogger(), tmp_path)
    message = naming(tmp_path, "No space left", "MB")
    with pytest.raises(WriteError, match=message):
        reporter.write("metrics", 10, {"a/return": 1.5})
    with pytest.raises(WriteError, match=message):
        reporter.close()


def test_points_after_a_checkpoint_are_hidden_when_a_run_resumes(tmp_path):
    for resumed, value in ((0, 1.0), (10, 2.0)):
        reporter = make_reporter(LoggerKind.tensorboard, tmp_path, "run", resumed)
        for frames in (10, 20) if not resumed else (20,):
            reporter.write("metrics", frames, {"x": value})
        reporter.close()
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    assert [(p.step, p.value) for p in events.Scalars("metrics/x")] == [(10, 1.0), (20, 2.0)]


def test_tensorboard_holds_histograms_and_the_video(tmp_path):
    pictures = [np.full((32, 48, 3), level, np.uint8) for level in (0, 80, 160, 240) * 5]
    write_video(tmp_path / "video.mp4", pictures, None, 20, 22_050)
    gif = animated_gif(tmp_path / "video.mp4", fps=10)
    reporter = make_reporter(LoggerKind.tensorboard, tmp_path, "run")
    reporter.write_values(10, {"actions/red": np.array([[0.0, 1.0], [1.0, 1.0]])})
    reporter.write_video(10, gif)
    reporter.close()
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    (histogram,) = events.Histograms("actions/red")
    assert (histogram.step, histogram.histogram_value.num) == (10, 4.0)
    assert histogram.histogram_value.sum == pytest.approx(3.0)
    (image,) = events.Images("video")
    shown = Image.open(BytesIO(image.encoded_image_string))
    assert shown.size == (24, 16)
    assert shown.n_frames == 10  # every second picture


@pytest.mark.parametrize("kind", [LoggerKind.wandb, LoggerKind.mlflow])
def test_a_logger_that_is_not_installed_is_refused_by_name(monkeypatch, kind):
    monkeypatch.setattr("veca_marl.algos.reporting.find_spec", lambda name: None)
    command = f"pip install 'veca_marl[{kind.name}]'"
    with pytest.raises(ValueError, match=naming("log.logger", command)):
        check_installed(kind)


def test_table_of_times_accounts_for_the_whole():
    timeit.erase()
    for part in ("collect", "learn"):
        with timeit(part):
            sum(range(100_000))
    lines = timing_table(elapsed_s=1.0, frames=100).splitlines()
    timeit.erase()
    assert [line.split()[0] for line in lines] == ["part", "collect", "learn", "other", "total"]
    shares = [float(line.split()[2].rstrip("%")) for line in lines[1:]]
    assert sum(shares[:-1]) == pytest.approx(100.0, abs=0.3)
    assert lines[-1].split()[-1] == "10.000"


def test_a_part_within_another_has_a_line_after_the_total_and_counts_once():
    timeit.erase()
    with timeit("evaluate"), timeit("evaluate/video"):
        sum(range(100_000))
    spent = timeit.todict(percall=False)
    lines = timing_table(elapsed_s=2.0 * spent["evaluate"], frames=100).splitlines()
    timeit.erase()
    names = ["part", "evaluate", "other", "total", "evaluate/video"]
    assert [line.split()[0] for line in lines] == names
    shares = [float(line.split()[2].rstrip("%")) for line in lines[1:]]
    video = 50.0 * spent["evaluate/video"] / spent["evaluate"]
    assert shares == pytest.approx([50.0, 50.0, 100.0, video], abs=0.1)


@pytest.mark.parametrize("kind", [LoggerKind.wandb, LoggerKind.mlflow])
def test_the_loggers_of_the_extras_write_into_the_folder_of_the_run(tmp_path, monkeypatch, kind):
    pytest.importorskip(kind.name, reason=f"needs the extra [{kind.name}]")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    for resumed in (0, 10):  # a closed logger lets another one start
        reporter = make_reporter(kind, tmp_path, "run", resumed)
        reporter.write("metrics", resumed + 10, {"x": 1.5, "y": math.nan})
        reporter.close()
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"wandb" if kind is LoggerKind.wandb else "mlflow.db"}


def test_a_resumed_run_continues_its_run_in_mlflow(tmp_path, monkeypatch):
    mlflow = pytest.importorskip("mlflow", reason="needs the extra [mlflow]")
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    for identifier, resumed in (("one", 0), ("one", 10), ("two", 0)):
        reporter = make_reporter(LoggerKind.mlflow, tmp_path, identifier, resumed)
        reporter.write("metrics", resumed + 10, {"x": 1.5})
        reporter.close()
    client = mlflow.MlflowClient(f"sqlite:///{tmp_path / 'mlflow.db'}")
    experiment = client.get_experiment_by_name("veca_marl").experiment_id
    points = [
        [point.step for point in client.get_metric_history(run.info.run_id, "metrics/x")]
        for run in client.search_runs([experiment], order_by=["attributes.start_time"])
    ]
    assert points == [[10, 20], [10]]
