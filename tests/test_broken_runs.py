"""Damaged, incomplete and changed run folders: one clear sentence, and nothing is lost."""

import json
import shutil

import pytest
import torch
from omegaconf import OmegaConf
from refusals import naming
from stored_runs import train_tiny

from veca_marl import api
from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.config import ConfigError, to_config
from veca_marl.evaluate import main as evaluate
from veca_marl.runs.assembly import make_trainer
from veca_marl.runs.run_folder import RunFolder, open_run
from veca_marl.tournament import main as tournament
from veca_marl.train import stored_node

FRAMES = 8


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    folder = tmp_path_factory.mktemp("broken") / "complete"
    return train_tiny(folder, FRAMES, "log=silent")


@pytest.fixture
def run(complete, tmp_path):
    return RunFolder(shutil.copytree(complete, tmp_path / "run"))


def latest(run):
    return sorted(run.checkpoints.glob("frames_*.pt"))[-1]


def cut_off(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def change_config(run, key, value):
    node = OmegaConf.load(run.config)
    assert OmegaConf.select(node, key) != value
    OmegaConf.update(node, key, value)
    OmegaConf.save(node, run.config)


def change_checkpoint(run, **entries):
    content = torch.load(latest(run), weights_only=True) | entries
    torch.save({key: value for key, value in content.items() if value is not None}, latest(run))


def change_provenance(run):
    content = json.loads(run.provenance.read_text())
    del content["bodies"]
    run.provenance.write_text(json.dumps(content))


def remove_checkpoints(run):
    shutil.rmtree(run.checkpoints)


FOLDERS = {
    "configuration missing": (lambda r: r.config.unlink(), ("run", "config.yaml")),
    "configuration empty": (lambda r: r.config.write_text(""), ("config.yaml",)),
    "configuration is no YAML": (
        lambda r: r.config.write_text("task: [KickTheBall"),
        ("config.yaml", "expected"),
    ),
    "unknown task": (lambda r: change_config(r, "task.name", "Chess"), ("'Chess'", "KickTheBall")),
    "unknown key": (
        lambda r: change_config(r, "algo.clip_it", 3),
        ("config.yaml", "'algo.clip_it'"),
    ),
    "provenance missing": (lambda r: r.provenance.unlink(), ("provenance.json",)),
    "provenance cut off": (lambda r: cut_off(r.provenance), ("provenance.json",)),
    "older version": (change_provenance, ("run", "version")),
}
CHECKPOINTS = {
    "checkpoint cut off": (lambda r: cut_off(latest(r)), ("0008.pt", "cut off")),
    "checkpoint empty": (lambda r: latest(r).write_bytes(b""), ("0008.pt", "cut off")),
    "another format": (lambda r: change_checkpoint(r, format=2), ("0008.pt", "format 2")),
    "another file": (lambda r: torch.save({"x": 1}, latest(r)), ("0008.pt", "checkpoint")),
    "entry missing": (lambda r: change_checkpoint(r, state=None), ("0008.pt", "state")),
    "other content": (lambda r: change_checkpoint(r, state={"x": 1}), ("run", "KeyError")),
}
RESUMED = {
    "another algorithm": (
        lambda r: change_config(r, "algo.clip", 0.7),
        ("algo.clip", "0.2", "0.7", "total_frames", "log"),
    ),
    "another seed": (
        lambda r: change_config(r, "seed", 9),
        ("seed", " 0", " 9", "total_frames"),
    ),
    "another task": (
        lambda r: change_config(r, "task.name", "MoveToTarget"),
        ("config.yaml", "'task."),
    ),
}


def files(run):
    return {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()}


def resume(run, *overrides):
    cfg = to_config(stored_node(open_run(run.path), [f"resume={run.path}", *overrides]))
    return make_trainer(cfg, run)


def cases(*tables):
    table = {name: case for part in tables for name, case in part.items()}
    return pytest.mark.parametrize(("damage", "parts"), table.values(), ids=table)


@pytest.mark.slow
@cases(FOLDERS, CHECKPOINTS, RESUMED)
def test_a_run_that_cannot_be_resumed_is_unchanged(run, damage, parts):
    damage(run)
    before = files(run)
    with pytest.raises((ConfigError, CheckpointError), match=naming(*parts)):
        resume(run)
    assert files(run) == before


NO_CHECKPOINT = {"no checkpoint": (remove_checkpoints, ("run", "checkpoint"))}


@cases(
    {name: FOLDERS[name] for name in ("configuration empty", "provenance cut off")},
    {name: CHECKPOINTS[name] for name in ("checkpoint cut off", "other content")},
    NO_CHECKPOINT,
)
def test_evaluate_ends_in_one_line(run, capsys, damage, parts):
    damage(run)
    before = files(run)
    assert evaluate([f"run={run.path}", "episodes=1"]) == 2
    check_one_line(capsys, parts)
    assert files(run) == before


@cases({name: FOLDERS[name] for name in ("configuration missing", "older version")})
def test_tournament_ends_in_one_line(run, capsys, damage, parts):
    damage(run)
    assert tournament([f"run={run.path}", "episodes=1"]) == 2
    check_one_line(capsys, parts)


def check_one_line(capsys, parts):
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    with pytest.raises(ConfigError, match=naming(*parts)):
        raise ConfigError(line)


def test_the_checkpoint_before_a_damaged_one_is_named(run):
    before, damaged = (path.name for path in sorted(run.checkpoints.glob("frames_*.pt"))[-2:])
    cut_off(latest(run))
    with pytest.raises(CheckpointError, match=naming(damaged, before)):
        resume(run)
    latest(run).unlink()
    assert resume(run).progress.frames == 4


def test_a_run_that_was_killed_before_its_first_checkpoint_starts_at_frame_0(run):
    remove_checkpoints(run)
    assert resume(run).progress.frames == 0


def test_what_has_no_influence_on_the_result_can_be_changed(run):
    asked = ["log=csv", "log.video=false", "total_frames=1e3", "max_minutes=3", "threads=2"]
    cfg = to_config(stored_node(run, asked))
    assert cfg.log.progress_bar
    assert not cfg.log.video
    assert (cfg.total_frames, cfg.max_minutes, cfg.threads) == (1000, 3.0, 2)
    assert resume(run, *asked, "device=cpu", "threads=1").progress.frames == FRAMES


def test_changed_budgets_are_kept_when_a_run_is_continued_once_more(run):
    asked = [f"resume={run.path}", "total_frames=1000", "max_minutes=3", "log.video=false"]
    run.begin_again(stored_node(run, asked), asked, FRAMES)
    again = stored_node(run, [])
    assert (again.total_frames, again.max_minutes, again.log.video) == (1000, 3.0, False)
    assert again.resume is None
    assert resume(run).progress.frames == FRAMES


def test_training_from_python_does_not_ignore_a_run_to_be_resumed(run):
    with pytest.raises(
        ConfigError, match=naming(f"resume={run.path}", "python -m veca_marl.train")
    ):
        api.train("KickTheBall", overrides=[f"resume={run.path}"])


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("seed=3", ("seed", "total_frames", "max_minutes")),
        ("algo=mappo", ("algo", "total_frames", "max_minutes")),
        ("senses/audio=mono", ("senses/audio", "total_frames", "max_minutes")),
        ("+task=TurnBaby", ("KickTheBall", "TurnBaby")),
        ("device=tpu", ("device=tpu", "cpu")),
        ("total_frames=0", ("total_frames", " 0")),
    ],
)
def test_other_changes_are_refused(run, override, parts):
    before = files(run)
    with pytest.raises(ConfigError, match=naming(*parts)):
        resume(run, override)
    assert files(run) == before
