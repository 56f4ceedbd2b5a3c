"""Launchers and sweepers of other packages run the jobs of a sweep, where they are installed."""

import csv
import re
import subprocess
import sys
from importlib.util import find_spec

import pytest
import yaml
from commands import train
from paths import ROOT

GUIDE = ROOT / "docs" / "guides" / "clusters.md"
SWEEP = (
    *("-m", "+experiment=smoke", "log=silent", "senses/vision=blind", "threads=1"),
    "hydra.sweep.dir=sweep",
)
TRIALS = (
    *("hydra/sweeper=optuna", "hydra.sweeper.direction=maximize", "hydra.sweeper.n_trials=2"),
    *("hydra.sweeper.n_jobs=2", "algo.gamma=interval(0.9,0.99)"),
)


def installed(package):
    missing = find_spec(f"hydra_plugins.hydra_{package}") is None
    return pytest.mark.skipif(missing, reason=f"hydra_plugins.hydra_{package} is not installed")


joblib = installed("joblib_launcher")
optuna = installed("optuna_sweeper")
submitit = installed("submitit_launcher")


def sweep(folder, *words):
    # in a process of its own: launchers leave processes and threads that wait for more jobs
    command = [sys.executable, "-m", "veca_marl.train", *SWEEP, *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [file.parent for file in (folder / "sweep").rglob("metrics.csv")]


def frames(run):
    with (run / "metrics.csv").open() as file:
        return [row["frames"] for row in csv.DictReader(file)]


@joblib
@pytest.mark.slow
def test_joblib_runs_the_jobs_and_refuses_their_folders_afterwards(tmp_path):
    words = ("hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "seed=0,1")
    runs = sweep(tmp_path, *words)
    assert [frames(run) for run in runs] == [["64", "128", "192", "256"]] * 2
    with pytest.raises(AssertionError, match=r"error: .* holds a run already"):
        sweep(tmp_path, *words)


@optuna
@pytest.mark.slow
@pytest.mark.parametrize(
    "launcher", ["processes", pytest.param("joblib", marks=joblib)], ids=lambda name: name
)
def test_optuna_gets_the_scores_of_its_trials(tmp_path, launcher):
    runs = sweep(tmp_path, *TRIALS, f"hydra/launcher={launcher}")
    assert len(runs) == 2
    found = yaml.safe_load((tmp_path / "sweep" / "optimization_results.yaml").read_text())
    gammas = [yaml.safe_load((run / "config.yaml").read_text())["algo"]["gamma"] for run in runs]
    assert found["best_params"]["algo.gamma"] in gammas
    scores = []
    for run in runs:
        with (run / "evaluations.csv").open() as file:
            scores.append(float(list(csv.DictReader(file))[-1]["return"]))
    assert found["best_value"] == pytest.approx(max(scores))


@submitit
@pytest.mark.slow
def test_submitit_runs_jobs_of_several_processes(tmp_path):
    words = ("hydra/launcher=submitit_local", "hydra.launcher.timeout_min=10", "seed=0,1")
    runs = sweep(tmp_path, *words, "collect.groups=2", "collect.worlds=1")
    assert [frames(run) for run in runs] == [["64", "128", "192", "256"]] * 2


@submitit
def test_the_words_of_the_guide_for_slurm_are_fields_of_its_launcher(tmp_path, capsys):
    (shown,) = re.findall(r"```\n(python [^`]*submitit_slurm[^`]*)```", GUIDE.read_text())
    words = shown.replace("\\\n", " ").split()
    launcher = [word for word in words if word.startswith("hydra")]
    assert len(launcher) > 5
    options = ("+task=KickTheBall", *launcher, "--cfg", "hydra", "--package", "hydra.launcher")
    assert train(tmp_path, *options) == 0
    composed = yaml.safe_load(capsys.readouterr().out.replace("# @package", "#"))
    for word in launcher[1:]:
        key, _, value = word.partition("=")
        assert composed[key.rpartition(".")[2]] == yaml.safe_load(value)
