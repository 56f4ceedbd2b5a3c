"""The table of experts: what is played, stored, continued and refused."""

import csv
import os
import signal

import pytest
from knockouts import knockout
from paths import ROOT
from refusals import naming
from scipy import stats

from tools.experts_table.command import main
from tools.experts_table.episode_file import EpisodeFile, spread
from tools.experts_table.play import Job, Played, digest, game_cfg, play_all
from tools.experts_table.table import markdown, share_interval
from veca_marl.envs.core.benchmark import SEED
from veca_marl.envs.core.episodes import Episodes
from veca_marl.envs.core.expert import Expert, find_expert
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.processes.supervision import WorkerError
from veca_marl.runs.lock import locked
from veca_marl.sim.physics import PropCfg

BENCHMARK = ROOT / "experiments" / "experts" / "benchmark"
SHORT = ("tasks=[DodgeCar]", "frozen=false", "task.max_seconds=0.4")


def rows_of(folder, task="DodgeCar"):
    with (folder / f"{task}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def played(policy="expert", solved=1.0, score=1.0, episode=0):
    return Played(policy, episode, score, solved, 100, 2, 0.5, "c", 1, "0123456789-dirty")


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (3, 20), (95, 100), (100, 100)])
def test_the_interval_of_a_share_is_that_of_wilson(successes, trials):
    expected = stats.binomtest(successes, trials).proportion_ci(method="wilson")
    assert share_interval(successes, trials) == pytest.approx((expected.low, expected.high))


def test_a_second_call_plays_the_missing_episodes_only(tmp_path):
    words = [*SHORT, f"to={tmp_path}"]
    assert main([*words, "episodes=1"]) == 0
    first = rows_of(tmp_path)
    assert [(row["policy"], row["episode"]) for row in first] == [("expert", "0"), ("random", "0")]
    with (tmp_path / "DodgeCar.csv").open("a") as file:
        file.write("expert,1,0.3")  # a process was killed while it wrote
    assert main([*words, "episodes=2"]) == 0
    both = rows_of(tmp_path)
    assert both[:2] == first
    assert [row["episode"] for row in both[2:]] == ["1", "1"]
    assert "| DodgeCar | expert | 2 (version 0) |" in (tmp_path / "table.md").read_text()


@pytest.mark.slow
def test_tasks_without_frozen_episodes_are_left_out_of_all(tmp_path, capsys):
    with knockout():
        assert main([f"to={tmp_path}", "tasks=[all]", "episodes=0"]) == 0
        assert "left out, without frozen episodes: Knockout\n" in capsys.readouterr().err
        assert main([f"to={tmp_path}", "tasks=[Knockout]", "episodes=0"]) == 2
        error = capsys.readouterr().err
        assert all(part in error for part in ("error: ", "'Knockout'", "frozen=false"))


@pytest.mark.slow
def test_two_processes_play_the_same_episodes(tmp_path):
    alone, together = tmp_path / "alone", tmp_path / "together"
    assert main([*SHORT, f"to={alone}", "episodes=2"]) == 0
    assert main([*SHORT, f"to={together}", "episodes=2", "processes=2"]) == 0

    def scores(folder):
        return {(row["policy"], row["episode"]): row["score"] for row in rows_of(folder)}

    assert scores(alone) == scores(together)


class Deadly:
    """Kills the process that reads it."""

    @property
    def task(self):
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_process_that_is_killed_is_named_with_its_signal():
    with pytest.raises(WorkerError, match=r"process [01] .*SIGKILL"):
        list(play_all([Deadly(), Deadly()], 2, "commit"))


@pytest.mark.slow
def test_a_start_that_is_not_the_frozen_one_is_named_by_its_process():
    job = Job("DodgeCar", ("playground=single_room",), Script.random, 0, frozen=True)
    with pytest.raises(WorkerError, match=r"process 0 .*: ValueError: "):
        list(play_all([job], 2, "commit"))


def test_the_stored_return_is_that_of_the_frozen_episode(tmp_path):
    assert main([*SHORT, f"to={tmp_path}", "episodes=1"]) == 0
    game = Game(game_cfg("DodgeCar", SHORT[2:]))
    game.reset(Episodes(SEED, 0).next())
    total, done = 0.0, False
    while not done:
        game.play_script(game.players[0], Script.expert)
        outcome = game.advance()
        total, done = total + game.reward_of(outcome.terms["agents"]), outcome.done
    assert float(rows_of(tmp_path)[0]["score"]) == total
    assert rows_of(tmp_path)[0]["steps"] == "10"
    game.close()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["tasks=[Dodge]"], ("'Dodge'", "DodgeCar")),
        (["tasks=[DodgeCar]", "episodes=101"], ("episodes", "100", "101")),
        (["tasks=[DodgeCar,DodgeCar]"], ("tasks", "'DodgeCar'")),
        (["processes=0"], ("processes", " 0")),
        (["tasks=[DodgeCar]", "task.aim=0.5"], ("task.aim=0.5", "0.6")),
        (["tasks=[DodgeCar]", "playground=single_room"], ("benchmark", "DodgeCar", "starts")),
        (["tasks=[SoccerTwoPlayer]", "opponent.defender=runs/x"], ("runs/x",)),
    ],
)
def test_what_cannot_be_played_is_refused(tmp_path, capsys, words, parts):
    assert main([*words, f"to={tmp_path}"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)
    assert not (tmp_path / "table.md").exists()


def test_remarks_without_their_columns_are_refused_before_the_first_episode(tmp_path, capsys):
    (tmp_path / "remarks.csv").write_text("task,who\nDodgeCar,me\n")
    assert main([*SHORT, f"to={tmp_path}", "episodes=1"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("remarks.csv", "'policy'"))
    assert not (tmp_path / "DodgeCar.csv").exists()


def test_an_episode_that_is_stored_twice_is_refused(tmp_path, capsys):
    words = [*SHORT, f"to={tmp_path}", "episodes=1"]
    assert main(words) == 0
    file = tmp_path / "DodgeCar.csv"
    file.write_text(file.read_text() + file.read_text().splitlines()[1] + "\n")
    assert main(words) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in (str(file), "episode 0", "expert", " 2 "))


@pytest.mark.slow
def test_two_commands_do_not_play_for_one_folder_at_once(tmp_path, capsys):
    with locked(tmp_path):
        assert main([*SHORT, f"to={tmp_path}", "episodes=1"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in (str(tmp_path), str(os.getpid())))
    assert not (tmp_path / "DodgeCar.csv").exists()


def test_the_return_of_one_episode_has_no_interval():
    assert "| 1.00 [-] |" in markdown({"Walk": [played()]}, {})


def test_episodes_of_another_configuration_are_not_mixed(tmp_path, capsys):
    words = [*SHORT, f"to={tmp_path}", "episodes=1"]
    assert main(words) == 0
    assert main([*words, "task.aim=0.5"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("DodgeCar.csv", "configuration", "folder"))


def test_the_table_has_rates_with_intervals_and_marks_low_ones():
    episodes = [played(solved=float(n < 15), score=n, episode=n) for n in range(20)]
    episodes += [played("random", float(n < 5), -1.0, n) for n in range(20)]
    remarks = {("Walk", "expert"): "falls", ("Walk", "random"): "is pushed"}
    table = markdown({"Walk": episodes, "Aimless": [played(solved=None)]}, remarks)
    _, _, head, _, aimless, expert, random, *_ = table.splitlines()
    assert head.startswith("| task | policy | episodes | return | solved |")
    assert "| no goal | 400 | 0123456-dirty |" in aimless
    assert "| 20 (version 1) | 9.50 [6.73, 12.27] | 75% [53%, 89%] | 400 |" in expert
    assert expert.endswith("| below 95%; falls |")
    assert random.endswith("| above 20%; is pushed |")


def test_the_game_computes_only_the_senses_that_an_expert_reads(monkeypatch):
    game = Game(game_cfg("KickTheBall", ()))
    game.reset(Episodes(SEED, 0).next())
    player, seen = game.players[0], []
    expert = find_expert("KickTheBall")

    def act(self: Expert, observation):
        seen.append(set(observation))
        return (0.0, 0.0)

    monkeypatch.setattr(expert, "act", act)
    game.play_script(player, Script.expert)
    monkeypatch.setattr(expert, "reads", None)
    game.play_script(player, Script.expert)
    assert seen == [{"audio"}, {"audio", "vision"}]
    game.close()


@pytest.mark.parametrize("path", sorted(BENCHMARK.glob("[A-Z]*.csv")), ids=lambda path: path.stem)
def test_stored_episodes_are_of_the_present_configuration(path):
    """Otherwise the command of the table refuses them: whoever changes a task plays them again."""
    with path.open(newline="") as file:
        stored = {row["configuration"] for row in csv.DictReader(file)}
    assert stored == {digest(game_cfg(path.stem, ()))}


def test_a_field_that_was_added_changes_a_digest_only_with_another_value():
    cfg = game_cfg("ObjectNav", ())
    before = digest(cfg)
    cfg.playground.props.append(PropCfg(name="screen", size_m=[1.0, 0.1, 1.0]))
    with_screen = digest(cfg)
    cfg.playground.props[-1].partition = True
    assert len({before, with_screen, digest(cfg)}) == 3


def test_episodes_with_other_starts_are_not_mixed(tmp_path):
    file = EpisodeFile(tmp_path / "DodgeCar.csv")
    file.check([played()], "c", version=1)
    for version in (0, 2):
        with pytest.raises(ValueError, match=naming("DodgeCar.csv", "version 1", f" {version} ")):
            file.check([played()], "c", version)


@pytest.mark.slow
def test_replayed_episodes_are_the_same_or_named_with_both_outcomes(tmp_path, capsys):
    words = [*SHORT, f"to={tmp_path}"]
    assert main([*words, "episodes=3"]) == 0
    capsys.readouterr()
    assert main([*words, "replay=2"]) == 0
    assert capsys.readouterr().out == "4 stored episodes are the same\n"
    lines = (tmp_path / "DodgeCar.csv").read_text().splitlines(keepends=True)
    assert lines[3].startswith("expert,2,")
    lines[3] = lines[3].replace(",10,", ",11,")  # steps
    (tmp_path / "DodgeCar.csv").write_text("".join(lines))
    assert main([*words, "replay=2"]) != 0
    error = capsys.readouterr().err
    parts = ("DodgeCar expert 2", " 10 steps", " 11 steps", "1 of 4", "['DodgeCar']")
    assert all(part in error for part in parts)


def test_what_cannot_be_replayed_is_refused(tmp_path, capsys):
    assert main(["tasks=[DodgeCar]", "replay=1", f"to={tmp_path}"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in (f"to={tmp_path}", "['DodgeCar']"))
    assert main(["replay=1", f"to={tmp_path}"]) == 2
    assert f"to={tmp_path}" in capsys.readouterr().err
    assert main([*SHORT, f"to={tmp_path}", "episodes=1"]) == 0
    assert main([*SHORT, "task.aim=0.5", "replay=1", f"to={tmp_path}"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("DodgeCar.csv", "configuration"))
    assert main(["replay=-1"]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("replay", "-1"))


def test_replayed_episodes_are_spread_over_those_of_each_policy():
    rows = [played(policy, episode=n) for policy in ("random", "expert") for n in range(10)]
    chosen = [(row.policy, row.episode) for row in spread(rows, 3)]
    assert chosen == [(policy, n) for policy in ("expert", "random") for n in (0, 4, 9)]
    assert len(list(spread(rows[:2], 5))) == 2
