"""Each run has a name of its own for loggers that know the runs of all folders."""

import importlib.machinery
import json
import random

import pytest
import torch

from veca_marl.algos import reporting
from veca_marl.config import compose_node, to_config
from veca_marl.runs.assembly import make_reporters
from veca_marl.runs.run_folder import RunFolder


@pytest.fixture
def identifiers(monkeypatch):
    """The identifiers that wandb was given; it need not be installed."""
    given = []
    monkeypatch.setattr(reporting, "WandbLogger", lambda **options: given.append(options["id"]))
    spec = importlib.machinery.ModuleSpec("wandb", None)
    monkeypatch.setattr(reporting, "find_spec", lambda name: spec)
    return given


def test_runs_of_two_experiments_in_folders_of_one_name_are_two_in_wandb(identifiers, tmp_path):
    node = compose_node(["+task=KickTheBall", "log.logger=[wandb]"])
    runs = [RunFolder(tmp_path / name / "ppo" / "seed_0") for name in ("exp_a", "exp_b")]
    for run in runs:
        run.begin(node, [])
        make_reporters(to_config(node), run, 0)
    runs[0].begin_again(node, [], 128)
    moved = RunFolder(runs[0].path.rename(tmp_path / "moved"))
    make_reporters(to_config(node), moved, 128)
    first, second, resumed = identifiers
    assert first != second
    assert resumed == first


def test_a_run_of_an_earlier_version_keeps_the_name_made_of_its_path(tmp_path):
    run = RunFolder(tmp_path / "ppo" / "seed_0")
    run.path.mkdir(parents=True)
    run.provenance.write_text(json.dumps({"bodies": {}}))
    assert run.identifier == "ppo-seed_0"


def test_drawing_the_name_touches_no_generator(tmp_path):
    def states():
        return random.getstate(), torch.get_rng_state().tolist()

    before = states()
    RunFolder(tmp_path).begin(compose_node(["+task=KickTheBall"]), [])
    assert states() == before
