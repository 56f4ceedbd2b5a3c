"""Sweeps without an experiment: their folders, and a report on them with the words of the sweep."""

import subprocess
import sys
from pathlib import Path

import pytest

from veca_marl.reports.arms import compose_sweep
from veca_marl.sweeps.names import (
    arm_of,
    combinations,
    fixed_in,
    folder_of,
    is_sweep,
    run_name,
    varied_in,
)

COMMAND = ["+task=KickTheBall", "algo.clip=0.1", "senses/audio=hrtf,mono", "seed=1,2"]


def test_what_is_swept_names_a_run_and_what_is_constant_its_sweep():
    assert fixed_in(COMMAND) == ["+task=KickTheBall", "algo.clip=0.1"]
    assert folder_of(fixed_in(COMMAND)) == Path("runs/sweeps/KickTheBall,algo.clip=0.1")
    job = ["+task=KickTheBall", "algo.clip=0.1", "senses/audio=mono", "seed=2"]
    assert run_name(varied_in(job, COMMAND), 2) == "senses.audio=mono/seed_2"
    assert arm_of(["seed=3", "total_frames=100"]) == "default"
    assert combinations(COMMAND) == ([["senses/audio=hrtf"], ["senses/audio=mono"]], [1, 2])
    assert combinations(["+task=X", "seed=range(0,3)"]) == ([[]], [0, 1, 2])
    assert combinations(["+task=X", "a=1,2", "b=3,4"])[0] == [
        [f"a={a}", f"b={b}"] for a in (1, 2) for b in (3, 4)
    ]
    assert is_sweep(COMMAND)
    assert not is_sweep(fixed_in(COMMAND))


def test_long_names_tell_runs_apart():
    long = [f"task.weights.kick={'1' * 300}", "senses/audio=hrtf"]
    other = [long[0], "senses/audio=mono"]
    assert len(arm_of(long)) <= 200
    assert arm_of(long) != arm_of(other)


def test_its_combinations_are_the_arms_of_a_report():
    one, other = compose_sweep(COMMAND)
    assert (one.name, other.name) == ("senses.audio=hrtf", "senses.audio=mono")
    assert [arm.cfg.senses.audio.quality.value for arm in (one, other)] == ["hrtf", "mono"]
    assert one.cfg.algo.clip == 0.1
    assert one.cfg.experiment.seeds == [1, 2]
    assert list(one.cfg.experiment.arms) == [one.name, other.name]
    assert one.plain["experiment"]["arm"] is None  # as it is stored with the runs


@pytest.mark.slow
def test_a_sweep_is_reported_with_the_words_that_started_it(tmp_path):
    words = ["-m", "+task=KickTheBall", "senses/audio=hrtf,mono", "senses/vision=blind", "seed=1,2"]
    words += ["collect=one_process", "collect.worlds=2", "collect.steps=16", "total_frames=64"]
    words += ["eval.episodes=1", "eval.worlds=1", "task.max_seconds=0.4", "log=csv"]
    words += ["log.video=false"]
    for command, more in (("train", []), ("report", ["expert_episodes=1"])):
        done = subprocess.run(
            [sys.executable, "-m", f"veca_marl.{command}", *words, *more],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    (report,) = tmp_path.glob("runs/sweeps/KickTheBall*/report.md")
    text = report.read_text()
    for part in ("| senses.audio=hrtf | 2 |", "| senses.audio=mono | 2 |", "+task=KickTheBall"):
        assert part in text
