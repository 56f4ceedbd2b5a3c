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
    words = ["experiment.seeds=[5]", "experiment.arm=stereo,mono", "hydra.launcher.jobs=3"]
    jobs, at_once, _ = sweep("+experiment=audio_ablation", *words)
    assert at_once == 3
    arms = ["stereo", "mono"]
    assert [str(job.folder) for job in jobs] == [f"runs/audio_ablation/{a}/seed_5" for a in arms]
    assert [job.asked["senses"]["audio"]["quality"] for job in jobs] == arms
    assert [job.asked["seed"] for job in jobs] == [5, 5]
    assert jobs[0].asked["experiment"]["arm"] == "stereo"
    assert {"+experiment=audio_ablation", "experiment.arm=stereo", "seed=5"} < {*jobs[0].overrides}


def test_a_sweep_without_experiment_has_folders_named_by_its_overrides(sweep):
    jobs, _, _ = sweep("+task=KickTheBall", "seed=1", "senses/audio=mono,hrtf")
    assert [str(job.folder) for job in jobs] == [
        f"runs/sweeps/task=KickTheBall,senses.audio={quality}/seed_1"
        for quality in ("mono", "hrtf")
    ]


def test_the_jobs_find_presets_in_the_folder_of_config_dir(sweep, tmp_path):
    own = tmp_path / "own presets"
    (own / "clock").mkdir(parents=True)
    (own / "clock" / "slow.yaml").write_text("control_rate_hz: 10\n")
    (job,), _, _ = sweep("--config-dir", str(own), "+task=KickTheBall", "clock=slow")
    assert job.asked["clock"]["control_rate_hz"] == 10
    assert job.overrides[0] == f"--config-dir={own}"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["seed=0,1"], "error: seed: an experiment has experiment.seeds=[...]"),
        (["experiment.arm=deaf"], "error: experiment.arm=deaf: choices: hrtf, stereo, mono"),
        (
            ["experiment.arm=hrtf", "experiment.seeds=[0]", "hydra.launcher.jobs=0"],
            "error: hydra.launcher.jobs must be at least 1, got 0",
        ),
    ],
)
def test_wrong_words_end_in_one_line(sweep, words, message, capsys):
    with pytest.raises(SystemExit) as ended:
        sweep("+experiment=audio_ablation", *words)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
