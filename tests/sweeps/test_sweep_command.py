"""The sweep of the command `train`: arms, seeds and folders."""

import sys
from importlib import import_module

import pytest

TRAIN = import_module("veca_marl.train")


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    """Return the jobs and the number at a time of a command; nothing is started."""
    monkeypatch.chdir(tmp_path)
    seen = []

    def record(jobs, at_once, threads):
        seen.extend([jobs, at_once, threads])

    def call(*words):
        seen.clear()
        monkeypatch.setattr(sys, "argv", ["train", "-m", *words])
        TRAIN.prepare(words)
        monkeypatch.setattr(sys.modules["hydra_plugins.veca_marl_sweeps"], "run_sweep", record)
        TRAIN.main()
        return seen

    return call


def test_every_arm_is_run_with_every_seed_in_a_folder_of_its_own(sweep):
    jobs, at_once, _ = sweep(
        "+experiment=audio_ablation", "experiment.arm=hrtf,mono", "experiment.seeds=[0,5]",
        "total_frames=1e3", "hydra.launcher.jobs=3",
    )  # fmt: skip
    assert at_once == 3
    assert [str(job.folder) for job in jobs] == [
        f"runs/audio_ablation/{arm}/seed_{seed}" for arm in ("hrtf", "mono") for seed in (0, 5)
    ]
    assert [job.asked["senses"]["audio"]["quality"] for job in jobs] == ["hrtf"] * 2 + ["mono"] * 2
    assert [job.asked["seed"] for job in jobs] == [0, 5, 0, 5]
    assert jobs[0].asked["experiment"]["arm"] == "hrtf"
    assert list(jobs[0].overrides) == [
        "experiment.arm=hrtf", "seed=0", "+experiment=audio_ablation", "experiment.seeds=[0,5]",
        "total_frames=1000", "senses/audio=hrtf",
    ]  # fmt: skip


def test_a_sweep_without_experiment_has_folders_named_by_its_overrides(sweep):
    jobs, _, _ = sweep("+task=KickTheBall", "senses/audio=mono", "seed=0,1", "collect=one_process")
    assert [job.name for job in jobs] == [
        f"collect=one_process,senses.audio=mono,task=KickTheBall/seed_{seed}" for seed in (0, 1)
    ]
    assert jobs[0].folder.parts[:2] == ("runs", "sweeps")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["seed=0,1"], "error: seed: an experiment has experiment.seeds=[...]"),
        (["experiment.arm=deaf"], "error: experiment.arm=deaf: choices: hrtf, stereo, mono"),
        (["hydra.launcher.jobs=0"], "error: hydra.launcher.jobs must be at least 1, got 0"),
    ],
)
def test_wrong_words_end_in_one_line(sweep, words, message, capsys):
    with pytest.raises(SystemExit) as ended:
        sweep("+experiment=audio_ablation", *words)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
