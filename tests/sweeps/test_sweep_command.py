"""The sweep of the command `train`: arms, seeds and folders."""

import sys
from importlib import import_module

import pytest

from veca_marl.algos import storage

TRAIN = import_module("veca_marl.train")
sweep_module = import_module("veca_marl.sweeps.sweep")


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    """Return jobs, largest number at a time and cores of a command; nothing is started."""
    monkeypatch.chdir(tmp_path)
    seen = []

    def record(jobs, most, cores, fit):
        seen.extend([jobs, most, cores])

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
    jobs, most, _ = sweep("+experiment=audio_ablation", *words)
    assert most == 3
    arms = ["stereo", "mono"]
    assert [str(job.folder) for job in jobs] == [f"runs/audio_ablation/{a}/seed_5" for a in arms]
    assert [job.asked["senses"]["audio"]["quality"] for job in jobs] == arms
    assert [job.asked["seed"] for job in jobs] == [5, 5]
    assert jobs[0].asked["experiment"]["arm"] == "stereo"
    assert {"+experiment=audio_ablation", "experiment.arm=stereo", "seed=5"} < {*jobs[0].overrides}


@pytest.mark.slow
def test_a_sweep_without_experiment_has_folders_named_by_its_overrides(sweep):
    """By those that vary; the others name the folder of the sweep."""
    jobs, _, _ = sweep("+task=KickTheBall", "seed=1", "senses/audio=mono,hrtf")
    assert [str(job.folder) for job in jobs] == [
        f"runs/sweeps/KickTheBall/senses.audio={quality}/seed_1" for quality in ("mono", "hrtf")
    ]
    fixed = [f"task.weights.kick={number}" for number in (2,)] + ["algo.clip=0.1"]
    jobs, _, _ = sweep("+task=KickTheBall", *fixed, "algo.gamma=0.9,0.8", "seed=1,2")
    assert [str(job.folder) for job in jobs] == [
        f"runs/sweeps/KickTheBall,task.weights.kick=2,algo.clip=0.1/algo.gamma={gamma}/seed_{seed}"
        for gamma in (0.9, 0.8)
        for seed in (1, 2)
    ]
    (job,) = sweep("+task=KickTheBall", "hydra.sweep.dir=here", "hydra.sweep.subdir=there")[0]
    assert str(job.folder) == "here/there"


@pytest.mark.slow
def test_the_jobs_find_presets_in_the_folder_of_config_dir(sweep, tmp_path):
    own = tmp_path / "own presets"
    (own / "clock").mkdir(parents=True)
    (own / "clock" / "slow.yaml").write_text("control_rate_hz: 10\n")
    (job,), _, _ = sweep("--config-dir", str(own), "+task=KickTheBall", "clock=slow")
    assert job.asked["clock"]["control_rate_hz"] == 10
    assert job.overrides[0] == f"--config-dir={own}"


@pytest.fixture
def sac_sweep(tmp_path, monkeypatch):
    """Return how many of four runs, each with a buffer, run at a time and their threads."""
    monkeypatch.chdir(tmp_path)
    seen = []
    monkeypatch.setattr(sweep_module, "run_all", lambda _, *numbers: seen.extend(numbers) or [])
    monkeypatch.setattr(sys.modules["hydra_plugins.veca_marl_sweeps"], "usable_cores", lambda: 4)

    def call(available_gb, *words):
        seen.clear()
        monkeypatch.setattr(storage, "available_memory", lambda: int(available_gb * 1e9))
        small = ["senses/vision=blind", "senses/touch=numb", "threads=1"]
        small += ["collect.groups=1", "collect.threads=1"]
        monkeypatch.setattr(sys, "argv", ["train", "-m", *SAC_SWEEP, *small, *words])
        TRAIN.main()
        return seen[0], int(seen[1]["OMP_NUM_THREADS"])

    return call


SAC_SWEEP = ["+task=KickTheBall", "algo=sac", "seed=0,1,2,3", "algo.replay.capacity=400_000"]


@pytest.mark.slow
def test_runs_that_do_not_fit_into_the_memory_together_wait(sac_sweep, capsys):
    """Four cores; each run takes 0.81 GB for its replay buffer, 1.45 GB for its processes."""
    assert sac_sweep(20.0) == (4, 1)
    assert "at most 4 at a time\n" in capsys.readouterr().err
    assert sac_sweep(6.0) == (2, 2)
    assert "at most 2 at a time, because 4 do not fit into the memory" in capsys.readouterr().err
    assert sac_sweep(6.0, "hydra.launcher.jobs=1") == (1, 4)
    assert sac_sweep(1.5) == (1, 4)


@pytest.mark.slow
def test_a_run_that_does_not_fit_alone_ends_the_sweep_before_anything_is_started(sac_sweep, capsys):
    with pytest.raises(SystemExit) as ended:
        sac_sweep(0.8)
    assert ended.value.code == 2
    message = capsys.readouterr().err
    parts = ("seed_0", "memory", "0.81 GB", "0.80 GB", "algo.replay.capacity")
    assert all(part in message for part in parts)


@pytest.mark.slow
def test_an_impossible_run_is_named(sac_sweep, capsys):
    with pytest.raises(SystemExit) as ended:
        sac_sweep(20.0, "task.max_seconds=-1")
    assert ended.value.code == 2
    assert "/seed_0: task.max_seconds=-1.0" in capsys.readouterr().err


@pytest.mark.slow
def test_runs_that_have_ended_need_no_memory(sac_sweep, monkeypatch):
    job = import_module("veca_marl.sweeps.plans")
    monkeypatch.setattr(sweep_module, "plan", lambda one: job.Plan(one, job.Action.skip))
    assert sac_sweep(0.1)[0] >= 1


def test_several_experiments_in_one_command_are_refused(sweep, capsys):
    with pytest.raises(SystemExit):
        sweep("+experiment=smoke,first_light")
    assert "error: +experiment=smoke,first_light" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["seed=0,1"], ("error: seed", "experiment.seeds=[...]")),
        (["experiment.arm=deaf"], ("error: ", "experiment.arm=deaf", "hrtf", "stereo")),
        (["experiment.seeds=[]"], "error: experiment audio_ablation has no seeds: give"),
        (
            ["total_frames=1e4"],
            ("error: ", "=10000", "total_frames=409_600", "experiment.arms.stereo=[...]"),
        ),
        (
            ["experiment.arms.mono=['senses/audio=none']"],
            ("error: ", "senses/audio=none", "'none'"),
        ),
        (
            ["experiment.arm=hrtf", "experiment.seeds=[0]", "hydra.launcher.jobs=0"],
            ("error: ", "hydra.launcher.jobs", " 0"),
        ),
    ],
)
def test_wrong_words_end_in_one_line(sweep, words, parts, capsys):
    with pytest.raises(SystemExit) as ended:
        sweep("+experiment=audio_ablation", *words)
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)
