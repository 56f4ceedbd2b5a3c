"""Commands for teams: self-play, tournament, evaluation, opponents and algorithms by team."""

import csv
import json
import shutil

import commands
import pytest
import torch
from refusals import naming

from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.evaluation.evaluate import RandomTeams
from veca_marl.algos.evaluation.evaluate import evaluate as run_episodes
from veca_marl.algos.specs import team_specs
from veca_marl.config import ConfigError, compose
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.benchmark import Benchmark, parameters, read_starts
from veca_marl.evaluate import EvaluateOptions, evaluate_run
from veca_marl.evaluate import main as evaluate
from veca_marl.play.command import main as play
from veca_marl.runs.assembly import make_trainer
from veca_marl.runs.run_folder import RunFolder, stored_actors, stored_configuration
from veca_marl.tournament import main as tournament
from veca_marl.tournament import spread

TASK = [
    *("+task=PushOut1v1", "body=walker", "task.max_seconds=1"),
    *("senses/vision=blind", "senses/touch=numb"),
]
SMALL = [
    "collect=one_process",
    "collect.worlds=2",
    "collect.steps=16",
    "eval.episodes=2",
    "eval.worlds=2",
    "log=silent",
    "threads=1",
]


def train(folder, name, *arguments):
    return commands.train(folder, *TASK, *SMALL, f"hydra.run.dir={folder / name}", *arguments)


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def actors(run, team):
    last = sorted(run.glob("checkpoints/frames_*.pt"))[-1]
    return torch.load(last, weights_only=True)["state"]["algorithm"][team]["network"]


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    folder = tmp_path_factory.mktemp("self_play")
    turns = ["self_play.teams=[red,blue]", "eval.every_frames=32", "total_frames=128"]
    assert train(folder, "run", *turns, "+algo@learner.blue=mappo", "learner.blue.epochs=1") == 0
    return folder


@pytest.mark.slow
def test_past_policies_of_both_teams_are_stored(played):
    kept = sorted(path.name for path in (played / "run" / "pool").iterdir())
    frames = {"red": (0, 32, 96), "blue": (0, 64, 128)}
    assert kept == sorted(f"{team}_{n:012d}.pt" for team, ns in frames.items() for n in ns)
    assert not (played / "run" / "checkpoints" / "best.pt").exists()
    notes = (played / "run" / "comparison.txt").read_text()
    assert "no best.pt" in notes
    assert "no comparison with random actions" in notes
    assert "difference" not in notes
    # only the critic of blue observes the whole team
    central, own = (actors(played / "run", team) for team in ("blue", "red"))
    assert central.keys() != own.keys() or any(central[k].shape != own[k].shape for k in own)


@pytest.mark.slow
def test_a_run_is_played_into_a_video(played, tmp_path, capsys):
    video = tmp_path / "run.mp4"
    assert play([f"policy={played / 'run'}", f"video={video}", "opponent.blue=random"]) == 0
    assert video.stat().st_size > 1000
    assert play([f"policy={played}", f"video={video}"]) == 2
    assert "policy=" in capsys.readouterr().err


@pytest.mark.slow
def test_a_tournament_writes_the_matches_the_ratings_and_the_picture(played, capsys):
    pytest.importorskip("matplotlib", reason="the picture needs the extra [plot]")
    run = played / "run"
    assert tournament([f"run={run}", "tournament.members=2", "episodes=4"]) == 0
    matches, ratings = rows(run / "cross_play.csv"), rows(run / "elo.csv")
    assert {(m["red_frames"], m["blue_frames"]) for m in matches} == {
        (red, blue) for red in ("0", "96") for blue in ("0", "128")
    }
    for match in matches:
        assert int(match["episodes"]) == 4
        assert int(match["red_wins"]) + int(match["blue_wins"]) <= 4
    assert len(ratings) == 4
    assert (run / "cross_play.png").read_bytes().startswith(b"\x89PNG")
    assert len(capsys.readouterr().out.splitlines()) == 4


def test_a_tournament_without_a_place_for_its_picture_is_refused_before_it_is_played(
    played, capsys, monkeypatch
):
    monkeypatch.setattr("veca_marl.tournament.tournament", None)  # would be called
    picture = played / "run" / "cross_play.png"
    picture.unlink(missing_ok=True)
    picture.mkdir()
    assert tournament([f"run={played / 'run'}", "tournament.members=2", "episodes=4"]) == 2
    assert "cross_play.png" in capsys.readouterr().err
    picture.rmdir()


def test_a_tournament_needs_two_past_policies_of_a_team(played, tmp_path, capsys):
    run = shutil.copytree(played / "run", tmp_path / "short")
    for path in sorted((run / "pool").glob("blue_*"))[1:]:
        path.unlink()
    assert tournament([f"run={run}"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("policies", "blue: 1", " 2 "))


@pytest.mark.slow
def test_a_policy_of_another_run_is_an_opponent(played, tmp_path, capsys):
    assert train(tmp_path, "run", f"opponent.blue={played / 'run'}", "total_frames=32") == 0
    with (tmp_path / "run" / "metrics.csv").open() as file:
        columns = next(csv.reader(file))
    assert "red/policy_loss" in columns
    assert not [name for name in columns if name.startswith("blue/") and "loss" in name]
    evaluated = {row["team"] for row in rows(tmp_path / "run" / "evaluations.csv")}
    assert evaluated == {"red", "blue"}
    capsys.readouterr()
    # a run without self-play has no past policies
    assert tournament([f"run={tmp_path / 'run'}"]) == 2
    assert "self_play.teams" in capsys.readouterr().err


@pytest.mark.slow
def test_a_team_starts_from_the_parameters_of_another_run(played, tmp_path):
    other = shutil.copytree(played / "run", tmp_path / "other")
    first = [f"init_from.red={other}", "opponent.blue=idle", "algo.learning_rate=1e-6"]
    assert train(tmp_path, "run", *first, "total_frames=32", "log.keep_checkpoints=9") == 0
    started = tmp_path / "run" / "checkpoints" / "frames_000000000000.pt"
    begun = torch.load(started, weights_only=True)["state"]["algorithm"]["red"]
    learnt = actors(other, "red")
    assert begun["network"].keys() == learnt.keys()
    for name, array in learnt.items():
        torch.testing.assert_close(begun["network"][name], array, rtol=0.0, atol=0.0)
    assert not begun["optimizer"]["state"]
    # resumed, it continues from its own checkpoint, also without the other run
    shutil.rmtree(other)
    assert commands.train(tmp_path, f"resume={tmp_path / 'run'}", "total_frames=64") == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["init_from.green={run}"], ("init_from", "green", "red", "blue")),
        (["init_from.blue={run}", "opponent.blue=idle"], ("init_from", "['blue']", "red")),
        (["init_from.red=nowhere"], ("nowhere", "checkpoint")),
        (
            ["init_from.red={run}", "algo.network.vector_features=7"],
            ("vector_features=64", "7"),
        ),
        (["init_from.red={run}", "senses/vision=monocular"], ("vision", "absent")),
        (["init_encoders.red.vision={run}", "senses/vision=monocular"], ("encoder", "vision")),
        (["init_encoders.green.audio={run}"], ("init_encoders", "green", "red")),
        (["init_from.red={run}:green"], ("run", "'green'", "'blue'", "'red'")),
        (["algo.network.frozen=[smell]"], ("smell", "proprioception")),
    ],
)
def test_a_source_that_does_not_fit_is_refused(played, tmp_path, arguments, parts):
    overrides = [text.format(run=played / "run") for text in arguments]
    with pytest.raises((ConfigError, CheckpointError), match=naming(*parts)):
        make_trainer(compose([*TASK, *SMALL, *overrides]), RunFolder(tmp_path / "run"))
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_run_is_evaluated_against_another_opponent(played, tmp_path, capsys):
    table = tmp_path / "table.json"
    run, more = f"run={played / 'run'}", ["episodes=4", f"evaluate.json={table}"]
    assert evaluate([run, "opponent.blue=idle", "task.max_seconds=0.4", *more]) == 0
    rows = json.loads(table.read_text())
    assert [(row["player"], row["team"]) for row in rows] == [("policy", "red"), ("random", "red")]
    assert all(row["episodes"] == 4 and row["length"] == 10.0 for row in rows)
    assert rows[0]["return"] != rows[1]["return"]
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 4
    assert printed[3].startswith("red: return of policy")
    assert f"{rows[0]['return']:.3f}" in printed[1]
    # a checkpoint may be named instead, and the same seed gives the same episodes
    latest = sorted((played / "run" / "checkpoints").glob("*.pt"))[-1]
    again = [evaluate([f"run={latest}", "episodes=2", "seed=3"]) for _ in range(2)]
    first, second = capsys.readouterr().out.split("player")[1:]
    assert again == [0, 0]
    assert first == second


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("senses/vision=monocular", ("specs", "vision")),
        ("senses/audio=lout", ("senses/audio", "'lout'", "mono")),
        ("algo.clip=1", ("algo.clip=1", "body", "clock")),
        ("task=KickTheBall", ("task=KickTheBall", "PushOut1v1")),
        ("opponent.green=idle", ("opponent", "green", "red")),
        ("evaluate.exploration=loud", ("exploration", "loud", "deterministic")),
        ("episodes=0", ("episodes", " 0")),
        ("episode=4", ("'episode'", "episodes")),
    ],
)
def test_a_change_that_does_not_fit_is_refused(played, capsys, override, parts):
    assert evaluate([f"run={played / 'run'}", override]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)


@pytest.mark.slow
def test_frozen_episodes_are_those_of_their_seed(played, tmp_path, capsys, monkeypatch):
    run, table = f"run={played / 'run'}", tmp_path / "table.json"
    assert evaluate([run, "episodes=2", "seed=77", f"evaluate.json={table}"]) == 0
    expected = json.loads(table.read_text())
    game = compose(TASK).game
    starts = tuple(read_starts(game, 77, range(2)))
    frozen = Benchmark("PushOut1v1", 3, 77, parameters(game.task), starts)
    monkeypatch.setattr("veca_marl.evaluate.find_benchmark", lambda task: frozen)
    capsys.readouterr()
    assert evaluate([run, "episodes=benchmark", f"evaluate.json={table}"]) == 0
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first == "benchmark of PushOut1v1, version 3: 2 frozen episodes"
    assert second.startswith("other than in the default game: ")
    assert "task.max_seconds=1.0 (" in second
    assert json.loads(table.read_text()) == [{**row, "benchmark": 3} for row in expected]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["episodes=benchmark"], ("task.max_seconds=1.0",)),
        (["episodes=benchmark", "seed=2"], ("seed=2", "benchmark")),
        (["episodes=all"], ("episodes", "'benchmark'", "'all'")),
    ],
)
def test_other_games_than_the_benchmark_are_refused(played, capsys, words, parts):
    assert evaluate([f"run={played / 'run'}", *words]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)


def test_a_self_play_run_is_evaluated_against_an_expert(played, tmp_path, capsys):
    table = tmp_path / "table.json"
    words = [f"run={played / 'run'}", "opponent.blue=expert", "senses/audio=mono", "episodes=2"]
    assert evaluate([*words, "evaluate.exploration=stochastic", f"evaluate.json={table}"]) == 0
    assert [row["team"] for row in json.loads(table.read_text())] == ["red", "red"]


@pytest.mark.slow
def test_each_team_that_learnt_acts_at_random_against_the_policies_of_the_others(played):
    """If all acted at random at once, a team would meet other opponents than its own."""
    folder, seed = played / "run", 5
    options = EvaluateOptions(str(folder), episodes=4, seed=seed)
    table = evaluate_run(options, ["task.max_seconds=0.4"]).table
    cfg = stored_configuration(folder, ["task.max_seconds=0.4"], "run=")
    env = VecaEnv(cfg.game, 2, seed)
    policies = stored_actors(cfg, folder, team_specs(env))
    for team, other in (("red", "blue"), ("blue", "red")):
        random = RandomTeams(env, [team], [policies[other]])
        alone = run_episodes(env, random, 4, seed, cfg.eval.exploration)
        assert table["random"][team].returns.tolist() == alone[team].returns.tolist()
    env.close()


def test_evaluation_uses_the_stored_configuration_and_not_the_defaults_of_today(
    played, tmp_path, capsys
):
    old = tmp_path / "old"
    shutil.copytree(played / "run", old)
    config = old / "config.yaml"
    text = config.read_text()
    assert "max_seconds: 1.0" in text
    config.write_text(text.replace("max_seconds: 1.0", "max_seconds: 0.2"))
    table = tmp_path / "table.json"
    assert evaluate([f"run={old}", "episodes=2", f"evaluate.json={table}"]) == 0
    assert all(row["length"] == 5.0 for row in json.loads(table.read_text()))


def test_a_key_that_this_version_does_not_have_is_named(played, tmp_path, capsys):
    old = tmp_path / "old"
    shutil.copytree(played / "run", old)
    config = old / "config.yaml"
    config.write_text(config.read_text().replace("max_seconds:", "max_minuets:"))
    assert evaluate([f"run={old}"]) == 2
    error = capsys.readouterr().err
    assert "max_minuets" in error
    assert str(config) in error
    assert error.count("\n") == 1


def test_a_folder_that_is_no_run_is_refused(tmp_path, capsys):
    nowhere = tmp_path / "nowhere"
    for command in (tournament, evaluate):
        assert command([f"run={nowhere}"]) == 2
        assert f"run={nowhere}" in capsys.readouterr().err


def test_past_policies_are_chosen_evenly():
    assert spread([0, 1, 2, 3, 4, 5, 6], 3) == [0, 3, 6]
    assert spread([0, 5], 6) == [0, 5]


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["eval.every_frames=128"], ("total_frames=128", "'blue'")),
        (
            ["eval.every_frames=64", "algo=sac", "algo.replay.warm_up_frames=100"],
            ("'red'", "64", "algo.replay.warm_up_frames=100"),
        ),
    ],
)
def test_self_play_in_which_a_team_would_not_learn_is_refused(tmp_path, capsys, arguments, parts):
    turns = ["self_play.teams=[red,blue]", "total_frames=128", *arguments]
    assert train(tmp_path, "run", *turns) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)
