"""The command line of `train`."""

import csv
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch
import yaml
from killed_runs import assert_equal
from refusals import naming
from training import TIMES

from veca_marl.config import ConfigError
from veca_marl.runs.assembly import find_device

KILLS = int(os.environ.get("VECA_TEST_KILLS", "20"))
SMOKE = ["+experiment=smoke", "log=silent", "device=cpu", "threads=1"]


def command(*arguments):
    return [sys.executable, "-m", "veca_marl.train", *arguments]


def train(folder, *arguments):
    return subprocess.run(command(*arguments), cwd=folder, capture_output=True, text=True)


def networks(run):
    last = sorted(run.glob("checkpoints/frames_*.pt"))[-1]
    return torch.load(last, weights_only=True)["state"]["algorithm"]["agents"]["network"]


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_available_devices_are_found_and_others_raise_an_error(monkeypatch):
    assert find_device("cpu") == torch.device("cpu")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ConfigError, match=r"device=cuda\b.*: cpu$"):
        find_device("cuda")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert find_device("cuda:1") == torch.device("cuda:1")
    with pytest.raises(ConfigError, match=naming("device=cuda:2", "cpu, cuda, cuda:0, cuda:1")):
        find_device("cuda:2")


def test_the_help_fits_a_screen_and_names_the_choices(tmp_path):
    shown = train(tmp_path, "--help")
    assert shown.returncode == 0
    lines = shown.stdout.splitlines()
    assert len(lines) <= 50
    assert max(map(len, lines)) <= 80
    for part in ("+task=", "resume=", "KickTheBall", "workers32", "total_frames", "--cfg job"):
        assert part in shown.stdout
    assert "schema" not in shown.stdout  # parts of presets are no choices


@pytest.fixture(scope="module")
def smoke(tmp_path_factory):
    folder = tmp_path_factory.mktemp("train")
    logs = ["log.video=true", "log.logger=[csv,tensorboard]"]
    done = train(folder, *SMOKE, *logs, "hydra.run.dir=run")
    assert done.returncode == 0, done.stderr
    return folder / "run", done.stdout


@pytest.mark.slow
def test_smoke_run_writes_all_files(smoke):
    run, printed = smoke
    files = {path.relative_to(run).as_posix() for path in run.rglob("*") if path.is_file()}
    assert {
        "config.yaml", "provenance.json", "metrics.csv", "evaluations.csv", "comparison.txt",
        "progress.json", "timing.txt", "videos/final.mp4", "videos/episode.html",
        "checkpoints/best.pt",
        "checkpoints/frames_000000000256.pt",
    } <= files  # fmt: skip
    assert any(name.startswith("tensorboard/events") for name in files)
    assert yaml.safe_load((run / "config.yaml").read_text())["task"]["name"] == "KickTheBall"
    assert len(rows(run / "metrics.csv")) == 4
    line = (run / "comparison.txt").read_text().strip()
    assert line.startswith("agents: return of policy")
    assert line in printed
    assert "ms/frame" in printed


@pytest.fixture
def start():
    """A function that starts a command; what still runs at the end of the test is killed."""
    started = []

    def begin(words, folder, new_group=False):
        options = {"stderr": subprocess.PIPE, "text": True, "start_new_session": new_group}
        started.append(subprocess.Popen(words, cwd=folder, **options))
        return started[-1]

    yield begin
    for process in started:
        process.kill()
        process.wait()
        process.stderr.close()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no groups of processes")
def test_a_job_is_ended_by_sigterm_to_all_of_its_processes(tmp_path, start):
    """Slurm and systemd send it so; the workers may end before the process that started them."""
    workers = [
        "collect.groups=2",
        "collect.processes=2",
        "collect.worlds=1",
        "total_frames=1000000",
    ]
    running = start(command(*SMOKE, *workers, "hydra.run.dir=run"), tmp_path, new_group=True)
    deadline = time.monotonic() + 300
    while not list(tmp_path.glob("run/checkpoints/frames_*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGTERM)
    _, errors = running.communicate(timeout=120)
    assert running.returncode == 130, errors
    assert "continue with: python -m veca_marl.train resume=" in errors
    assert "Traceback" not in errors


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_interrupted_and_resumed_equals_uninterrupted(smoke, tmp_path, start):
    """Ctrl-C in the second stage of the real task, then the command that it prints."""
    whole, _ = smoke
    arguments = [*SMOKE, "total_frames=25600", "hydra.run.dir=run"]
    running = start(command(*arguments), tmp_path)
    run = tmp_path / "run"
    deadline = time.monotonic() + 300
    while not list(run.glob("checkpoints/frames_*128.pt")) and time.monotonic() < deadline:
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=120)
    assert running.returncode == 130, errors
    assert "interrupted; continue with: python -m veca_marl.train resume=" in errors
    assert "Traceback" not in errors
    for late in [p for p in run.glob("checkpoints/frames_*.pt") if int(p.stem[7:]) > 128]:
        late.unlink()  # a fast machine may have come further

    done = train(tmp_path, f"resume={run}", "total_frames=256")
    assert done.returncode == 0, done.stderr
    mine, other = networks(whole), networks(run)
    assert mine.keys() == other.keys()
    assert all(torch.equal(mine[name], other[name]) for name in mine)

    def numbers(folder):
        table = rows(folder / "metrics.csv")
        return [{k: v for k, v in row.items() if k not in TIMES} for row in table]

    assert numbers(whole) == numbers(run)


@pytest.mark.slow
def test_an_existing_run_is_not_overwritten(smoke):
    run, _ = smoke
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    for arguments, parts in (
        ([*SMOKE, f"hydra.run.dir={run}"], (f"resume={run}",)),
        ([f"resume={run}", "senses/audio=mono"], ("senses/audio", "total_frames")),
        ([f"resume={run}", "seed=3"], ("seed", "total_frames", "max_minutes")),
    ):
        done = train(run.parent, *arguments)
        assert done.returncode == 2
        assert all(part in done.stderr for part in parts)
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ([], ("+task=NAME", "BabyzumasRevenge", "ChaseCar")),
        (["task=KickTheBall"], ("+task=KickTheBall",)),
        (["+task=KickTheBal"], ("'KickTheBal'", "KickTheBall", "MazeNav")),
        (["+task=KickTheBall", "sede=1"], ("'sede'", "seed", "playground")),
        (["+task=KickTheBall", "algo.clip=-1"], ("algo.clip", "-1.0")),
        (["+task=KickTheBall", "device=tpu"], ("device=tpu", "cpu")),
        (["resume=nowhere"], ("resume=", "nowhere")),
        ([f"resume={__file__}"], (f"resume={__file__}", "folder")),
        (
            ["+task=KickTheBall", "hydra.run.dir=/dev/null/run"],
            ("hydra.run.dir=/dev/null/run", " /dev/null "),
        ),
    ],
)
def test_a_wrong_command_ends_in_one_line_and_leaves_nothing(tmp_path, arguments, parts):
    done = train(tmp_path, *arguments)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert re.match(naming("error: ", *parts), line)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not list(tmp_path.glob("runs/*/*"))


@pytest.mark.slow
def test_logged_lines_and_diverged_learning_are_seen(tmp_path):
    sac = ["algo=sac", "algo.replay={capacity: 2000, warm_up_frames: 16}", "algo.batch_size=16"]
    done = train(tmp_path, *SMOKE, *sac, "algo.learning_rate=1e12", "hydra.run.dir=run")
    assert done.returncode == 1
    assert "replay: 0." in done.stderr  # the memory that it takes
    *_, last = done.stderr.strip().splitlines()
    assert re.search(naming("error: ", "'agents'", "gradient"), last)
    assert last.endswith(f"continue with: python -m veca_marl.train resume={tmp_path}/run")


def comparable(run):
    """Return what a finished run has stored, without what depends on the clock and the command."""
    tables = {
        name: [{k: v for k, v in row.items() if k not in TIMES} for row in rows(run / name)]
        for name in ("metrics.csv", "evaluations.csv")
    }
    states = {
        path.name: torch.load(path, weights_only=True)["state"]
        for path in run.glob("checkpoints/*.pt")
    }
    # a run that was killed after its last checkpoint adds that nothing was learnt
    compared = (run / "comparison.txt").read_text().splitlines()[0]
    return tables | states | {"comparison": compared}


WITH_VIDEO = [*SMOKE, "log.video=true", "log.logger=[csv,tensorboard]"]


def start_or_continue(folder):
    """Start the run in `folder`, or continue it, as its user would."""
    run = folder / "run"
    known = (run / "config.yaml").exists()
    arguments = [f"resume={run}"] if known else [*WITH_VIDEO, "hydra.run.dir=run"]
    return subprocess.Popen(command(*arguments), cwd=folder)


@pytest.mark.slow
def test_a_run_killed_at_random_moments_stores_the_same(smoke, tmp_path):
    """From the creation of the folder to the video; `smoke` is the run that is not interrupted."""
    whole, _ = smoke
    begin = time.monotonic()
    assert start_or_continue(tmp_path).wait() == 0
    duration, rng = time.monotonic() - begin, random.Random(0)
    for _ in range(KILLS):
        if (tmp_path / "run" / "comparison.txt").exists():
            assert_equal(comparable(tmp_path / "run"), comparable(whole))
            shutil.rmtree(tmp_path / "run")
        running = start_or_continue(tmp_path)
        try:
            running.wait(rng.uniform(0.2, 1.1) * duration)
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()
    assert start_or_continue(tmp_path).wait() == 0
    assert_equal(comparable(tmp_path / "run"), comparable(whole))
    assert (tmp_path / "run" / "videos" / "final.mp4").exists()
    assert not list((tmp_path / "run").rglob("*.tmp"))


def workers_of(pid):
    """Return the forked children of a process; they have its command line."""
    own = Path(f"/proc/{pid}/cmdline").read_bytes()
    found = map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
    return [child for child in found if Path(f"/proc/{child}/cmdline").read_bytes() == own]


def is_running(pid):
    return Path(f"/proc/{pid}").exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(
    ("number", "name"), [(1, "evaluation process 1"), (3, "worker process 1 (of 0 to 1)")]
)
def test_a_killed_process_ends_the_command_with_its_name(tmp_path, start, number, name):
    arguments = [
        *SMOKE,
        "collect=workers8",
        "collect.worlds=1",
        "collect.steps=32",
        "total_frames=1e5",
    ]
    running = start(command(*arguments, "hydra.run.dir=run"), tmp_path)
    deadline = time.monotonic() + 300
    while not list(tmp_path.glob("run/checkpoints/frames_*128.pt")) and time.monotonic() < deadline:
        assert running.poll() is None, running.stderr.read()
        time.sleep(0.05)
    workers = workers_of(running.pid)  # those that evaluate, then those that collect
    assert len(workers) == 4
    os.kill(workers[number], signal.SIGKILL)
    begin = time.monotonic()
    _, errors = running.communicate(timeout=60)
    assert time.monotonic() - begin < 20
    assert running.returncode == 1
    (line,) = errors.strip().splitlines()
    assert re.match(naming("error: ", name, "SIGKILL"), line)
    assert f"continue with: python -m veca_marl.train resume={tmp_path / 'run'}" in line
    assert not any(map(is_running, workers))
    done = train(tmp_path, f"resume={tmp_path / 'run'}", "total_frames=256", "log.video=false")
    assert done.returncode == 0, done.stderr
