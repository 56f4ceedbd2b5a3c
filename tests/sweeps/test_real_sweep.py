"""A sweep of real runs, interrupted and continued by the same command."""

import csv
import signal
import subprocess
import sys
import time

import pytest

COMMAND = [
    *(sys.executable, "-m", "veca_marl.train", "-m", "+experiment=smoke"),
    *("seed=0,1", "log=silent", "senses/vision=blind", "threads=1", "total_frames=1024"),
    *("hydra.launcher.jobs=2", "hydra.sweep.dir=sweep", "hydra.sweep.subdir=seed_${seed}"),
]


def frames(run):
    with (run / "metrics.csv").open() as file:
        return [row["frames"] for row in csv.DictReader(file)]


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_the_same_command_continues_an_interrupted_sweep(tmp_path):
    first = subprocess.Popen(COMMAND, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 300
    reached = "sweep/seed_1/checkpoints/frames_*128.pt"
    while not list(tmp_path.glob(reached)) and time.monotonic() < deadline:
        time.sleep(0.05)
    first.send_signal(signal.SIGINT)
    _, shown = first.communicate(timeout=120)
    assert first.returncode == 130, shown
    assert "interrupting 2 runs; the same command continues them" in shown

    second = again(tmp_path)
    assert second.returncode == 0, second.stderr
    assert "2 runs: 0 skipped (they have ended), 2 to continue, 0 to start" in second.stderr
    for seed in (0, 1):
        assert frames(tmp_path / "sweep" / f"seed_{seed}") == [str(64 * k) for k in range(1, 17)]

    third = again(tmp_path)
    assert third.returncode == 0, third.stderr
    assert "2 runs: 2 skipped (they have ended), 0 to continue, 0 to start" in third.stderr

    other = again(tmp_path, "algo.clip=0.1")
    assert other.returncode == 2
    assert all(part in other.stderr for part in ("algo.clip", "0.2", "0.1"))


def again(folder, *more):
    return subprocess.run([*COMMAND, *more], cwd=folder, capture_output=True, text=True)
