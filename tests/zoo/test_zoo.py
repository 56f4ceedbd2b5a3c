"""Policies without their runs: files, names, commands and functions."""

import json
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from refusals import naming
from safetensors.torch import load_file, save_file
from stored_runs import train_tiny

import veca_marl
from veca_marl import policy_paths
from veca_marl.algos.checkpoints import CheckpointError, checkpoints_in, read_checkpoint
from veca_marl.algos.policy_files import LARGEST_BYTES, read_policy, write_policy
from veca_marl.algos.specs import team_specs
from veca_marl.algos.transfer import load_actor, load_learnt
from veca_marl.config import ConfigError, compose
from veca_marl.envs.core.benchmark import parameters
from veca_marl.evaluate import main as evaluate
from veca_marl.play.command import main as play
from veca_marl.policy_paths import policy_path, zoo_names
from veca_marl.zoo import entries, load
from veca_marl.zoo.command import AddOptions, add, default_task, main
from veca_marl.zoo.entries import read_entry

QUIET = ("log=csv", "log.video=false", "log.progress_bar=false")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return train_tiny(tmp_path_factory.mktemp("runs") / "run", 8, *QUIET)


@pytest.fixture(scope="module")
def stored(run, tmp_path_factory):
    """The file of a policy of that run."""
    return add(AddOptions(str(run), "Tiny", str(tmp_path_factory.mktemp("zoo")), episodes=2))


@pytest.fixture
def zoo(stored, monkeypatch):
    """A zoo with that policy alone."""
    monkeypatch.setattr(policy_paths, "_POLICIES", stored.parent)


def test_a_file_holds_parameters_configuration_and_provenance(run, stored):
    content = read_policy(stored)
    original = read_checkpoint(checkpoints_in(run / "checkpoints")[-1], torch.device("cpu"))
    assert stored.stat().st_size <= LARGEST_BYTES
    assert content["identity"] == original["identity"]
    assert content["algorithms"] == original["algorithms"]
    for team, actor in original["state"]["actors"].items():
        for name, tensor in actor.items():
            torch.testing.assert_close(
                content["state"]["actors"][team][name], tensor, atol=1e-3, rtol=1e-3
            )
    entry = read_entry(stored)
    assert entry.frames == 8
    assert entry.provenance["packages"]["veca_marl"] == veca_marl.__version__
    assert {row["player"] for row in entry.evaluation} == {"policy", "random"}
    assert all(np.isfinite(row["return"]) for row in entry.evaluation)


def test_actor_and_start_of_learning_are_read_from_it(run, stored, zoo):
    policy = load("Tiny")
    env = policy.make(worlds=2, seed=1)
    specs = team_specs(env)
    for team, spec in specs.items():
        load_actor(stored, team, spec)
        learnt = load_learnt(stored, team, spec)
        assert all(torch.isfinite(p).all() for p in learnt.actor.parameters())
    rollout = env.rollout(3, policy=policy.module)
    assert rollout.batch_size == torch.Size([2, 3])
    env.close()


def test_the_policy_acts_as_that_of_the_run(run, stored, zoo):
    policy = load("zoo/Tiny")
    env = policy.make(seed=1)
    (team,) = env.group_map
    own = load_actor(run, team, team_specs(env)[team])
    state = env.reset()
    with torch.no_grad():
        ours, theirs = own(state.clone()), policy.module(state.clone())
    for key in ("loc", "scale", "logits"):
        if (team, key) in ours.keys(include_nested=True):
            torch.testing.assert_close(theirs[team, key], ours[team, key], atol=2e-2, rtol=2e-2)
    env.close()


def test_commands_take_names_of_the_zoo(zoo, tmp_path, capsys):
    assert main(["list"]) == 0
    assert "zoo/Tiny" in capsys.readouterr().out
    film = tmp_path / "tiny.mp4"
    small = ["play.width=320", "play.height=180", "play.quality=fast", f"video={film}"]
    assert play(["policy=zoo/Tiny", *small]) == 0
    assert film.stat().st_size > 1000
    for option in ("policy", "run"):
        assert evaluate([f"{option}=zoo/Tiny", "episodes=2"]) == 0
        assert "policy" in capsys.readouterr().out


def test_a_team_starts_from_it_and_plays_against_it(zoo):
    entry = read_entry(policy_path("zoo/Tiny"))
    (team,) = entry.algorithm
    cfg = compose([f"+task={entry.task}", f"init_from.{team}=zoo/Tiny"])
    assert cfg.init_from == {team: "zoo/Tiny"}
    contest = compose(["+task=PushOut1v1", "opponent.blue=zoo/Tiny"])
    assert contest.frozen == {"blue": policy_path("zoo/Tiny")}
    with pytest.raises(ConfigError, match=naming("opponent.blue", "zoo/Nobody", "zoo/Tiny")):
        compose(["+task=PushOut1v1", "opponent.blue=zoo/Nobody"])


@pytest.mark.parametrize(
    "call", [lambda words: play([*words, "video=a.mp4"]), evaluate], ids=["play", "evaluate"]
)
def test_an_unknown_name_ends_in_one_line_with_the_choices(zoo, capsys, call):
    assert call(["policy=zoo/Nobody"]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert re.search(naming("zoo/Nobody", "zoo/Tiny"), said)


def test_evaluate_needs_a_policy_and_only_one(capsys):
    assert evaluate([]) == 2
    assert evaluate(["run=a", "policy=b"]) == 2
    assert "policy=b" in capsys.readouterr().err


def test_wrong_words_end_in_one_line(capsys, tmp_path):
    for words in (["sing"], ["add"], ["add", str(tmp_path / "none")], ["list", "seed=1"]):
        assert main(words) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert main(["--help"]) == 0
    assert main(["add", "--help"]) == 0


def changed_file(stored, path, change):
    """Write a copy of a file with other tensors or another text."""
    from safetensors import safe_open

    with safe_open(stored, framework="pt") as file:
        text = json.loads(file.metadata()["veca_marl"])
    tensors = load_file(stored)
    change(text, tensors)
    save_file(tensors, path, {"veca_marl": json.dumps(text)})
    return path


def test_damaged_files_are_refused(stored, tmp_path):
    def other_number(text, tensors):
        next(iter(tensors.values())).view(-1)[0] += 1.0

    def no_names(text, tensors):
        del text["names"]

    def newer(text, tensors):
        text["format"] = 999

    for number, change in enumerate((other_number, no_names, newer)):
        path = changed_file(stored, tmp_path / f"{number}.safetensors", change)
        with pytest.raises(CheckpointError, match=str(number)):
            read_policy(path)
    cut = tmp_path / "cut.safetensors"
    cut.write_bytes(stored.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match="cut"):
        read_policy(cut)


def test_nothing_in_a_file_is_executed(tmp_path):
    class Evil:
        def __reduce__(self):
            return (tmp_path.joinpath("executed").touch, ())

    path = tmp_path / "evil.safetensors"
    path.write_bytes(pickle.dumps(Evil()))
    with pytest.raises(CheckpointError, match=r"evil\.safetensors"):
        read_policy(path)
    assert not (tmp_path / "executed").exists()


def test_the_frozen_episodes_have_the_default_parameters_of_the_task():
    """Whatever a run has learnt from."""
    for words in (
        ["+task=KickTheBall", "task.max_seconds=0.2", "task.weights.kick=3.0"],
        ["+task=SitBaby", "task.starts={on_back:0.5,on_belly:0.5,on_all_fours:0,sitting:0}"],
    ):
        task = compose(words).task
        assert default_task(task)
        assert parameters(compose([*words, *default_task(task)]).task) == parameters(
            compose(words[:1]).task
        )
        assert default_task(compose(words[:1]).task) == []


def test_a_policy_that_is_too_large_is_not_written(run, tmp_path, monkeypatch):
    monkeypatch.setattr("veca_marl.algos.policy_files.LARGEST_BYTES", 1000)
    with pytest.raises(CheckpointError, match="1000"):
        add(AddOptions(str(run), "Large", str(tmp_path), episodes=1))
    assert not list(tmp_path.iterdir())


def test_critics_that_do_not_fit_are_left_out_and_learning_starts_with_the_actor(
    run, stored, tmp_path, monkeypatch
):
    largest = stored.stat().st_size - 200  # the text of other episodes has other digits
    with monkeypatch.context() as patch:
        patch.setattr("veca_marl.algos.policy_files.LARGEST_BYTES", largest)
        small = add(AddOptions(str(run), "Small", str(tmp_path), episodes=1))
    monkeypatch.setattr(policy_paths, "_POLICIES", tmp_path)
    assert "algorithm" not in read_policy(small)["state"]
    for team, spec in team_specs(load("Small").make()).items():
        whole, actor = load_learnt(stored, team, spec), load_learnt(small, team, spec)
        for expected, parameter in zip(
            whole.actor.parameters(), actor.actor.parameters(), strict=True
        ):
            assert torch.equal(expected, parameter)


@pytest.mark.usefixtures("zoo")
def test_learning_starts_with_the_actor_of_an_algorithm_without_other_networks(
    run, stored, tmp_path
):
    """Behaviour cloning has none."""
    content = read_checkpoint(checkpoints_in(run / "checkpoints")[-1], torch.device("cpu"))
    state = {**content["state"], "algorithm": {team: {} for team in content["state"]["actors"]}}
    cloned = tmp_path / "Cloned.safetensors"
    write_policy(cloned, {**content, "state": state}, {"bodies": {}})
    for team, spec in team_specs(load("Tiny").make()).items():
        whole, actor = (load_learnt(path, team, spec) for path in (stored, cloned))
        assert all(map(torch.equal, whole.actor.parameters(), actor.actor.parameters()))


def test_an_entry_that_exists_is_kept(run, stored, tmp_path):
    before = stored.read_bytes()
    with pytest.raises(ConfigError, match=naming("Tiny")):
        add(AddOptions(str(run), "Tiny", str(stored.parent), episodes=1))
    assert stored.read_bytes() == before
    with pytest.raises(ConfigError):  # found only when its episodes are to be played
        add(AddOptions(str(run), "Other", str(tmp_path), episodes=1), ["task.nonsense=1"])
    assert not list(tmp_path.iterdir())


def test_names_are_no_paths(run, tmp_path, monkeypatch, capsys):
    for words in (["name=../x"], ["name=/tmp/x"], ["episodes=0"]):
        assert main(["add", f"run={run}", f"to={tmp_path / 'zoo'}", *words]) == 2
        assert words[0].partition("=")[2] in capsys.readouterr().err
    content = read_checkpoint(checkpoints_in(run / "checkpoints")[-1], torch.device("cpu"))
    hostile = {**content, "identity": {**content["identity"], "task": str(tmp_path / "victim")}}
    monkeypatch.setattr("veca_marl.zoo.command.read_checkpoint", lambda *_: hostile)
    with pytest.raises(ConfigError, match="victim"):
        add(AddOptions(str(run), None, str(tmp_path / "zoo"), episodes=1))
    assert not list(tmp_path.iterdir())


def test_every_policy_of_this_package_fits_its_game_and_has_been_evaluated():
    for entry in entries():
        policy = load(entry.name)
        assert entry.size <= LARGEST_BYTES
        assert entry.frames > 0
        own = {row["team"]: row for row in entry.evaluation if row["player"] == "policy"}
        random = {row["team"]: row for row in entry.evaluation if row["player"] == "random"}
        for team, row in own.items():
            assert row["episodes"] == 100
            assert row["return"] > random[team]["return"]
        assert replace(entry, name="") == replace(policy.entry, name="")
    assert [entry.name for entry in entries()] == zoo_names()
