"""`check_task` passes a sound task, and reports each fault of tasks that have one."""

import re
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
import pytest
from composed import compose
from refusals import naming

import veca_marl
from veca_marl.checks import CheckCfg, Status, check_game
from veca_marl.checks.episodes import check_random_play, check_returns
from veca_marl.checks.starts import check_seeding, check_starts
from veca_marl.envs.core.expert import EXPERTS, Expert
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS, Task, TaskCfg, Team, terms
from veca_marl.sim.physics import PropCfg, PropShape

CHOSEN = compose(["+task=KickTheBall", "body=walker", "playground=simple"]).game
QUICK = CheckCfg(starts=5, steps=10, seeding_steps=4, episodes=4)


@dataclass
class EastCfg(TaskCfg):
    max_seconds: float = 1.0
    weights: dict[str, float] = terms(progress=1.0, arrived=1.0)


class East(Task):
    """Walk 0.4 m to the east."""

    senses = ("proprioception",)
    cfg: EastCfg

    def build(self):
        self.room = self.world.playground.rooms[0]

    def reset(self, rng):
        self.players[0].body.place(self.room.sample_floor(rng, margin_m=1.0))
        self.start = self.last = self.now = self.players[0].body.position[0]

    def after_step(self, rng):
        self.last, self.now = self.now, self.players[0].body.position[0]

    def reward(self, player):
        return {"progress": self.now - self.last, "arrived": float(self.solved(player))}

    def solved(self, player):
        return bool(self.now > self.start + 0.4)


class EastExpert(Expert):
    def act(self, observation):
        x, y = self.player.body.forward[:2]
        return float(x > 0.5), float(np.clip(-3.0 * np.arctan2(y, x), -1.0, 1.0))


class UnseededStart(East):
    def reset(self, rng):
        super().reset(np.random.default_rng())


class StateOfTheLastEpisode(East):
    episodes = 0

    def reset(self, rng):
        super().reset(rng)
        self.episodes += 1

    def reward(self, player):
        return {**super().reward(player), "arrived": float(self.episodes)}


class FixedStart(East):
    def reset(self, rng):
        super().reset(np.random.default_rng(0))


class StartOutside(East):
    def reset(self, rng):
        super().reset(rng)
        self.players[0].body.place((50.0, rng.uniform(), 0.0))


class StartsInAThing(East):
    def build(self):
        super().build()
        self.crate = self.world.add_prop(PropCfg("crate", PropShape.box, [0.3, 0.3, 0.3]))

    def reset(self, rng):
        super().reset(rng)
        self.crate.place(self.players[0].body.position * (1.0, 1.0, 0.0) + (0.0, 0.1, 0.15))


class EndsAtOnce(East):
    def terminated(self):
        return True


class SomeSolvedAtOnce(East):
    def solved(self, player):
        return bool(self.start > 0.0)


class AvoidsSomething(East):
    def solved(self, player):
        return True


class InfiniteTerm(East):
    def reward(self, player):
        return {**super().reward(player), "progress": float("nan")}


class TooGreatForFloat32(East):
    def reward(self, player):
        return super().reward(player) | {"progress": 1e39}


class TooGreatWithItsWeight(East):
    def __init__(self, cfg, world, players):
        super().__init__(cfg, world, players)
        cfg.weights["progress"] = 1e30

    def reward(self, player):
        return super().reward(player) | {"progress": 1e10}


class TermOfAnArray(East):
    def reward(self, player):
        return super().reward(player) | {"progress": np.array([self.now - self.last])}


class EliminatesNobody(East):
    def is_eliminated(self, player):
        return True


class TeamOfNobody(East):
    teams = (*East.teams, Team("red", 0))


class SolvedIsForgotten(East):
    def reward(self, player):
        return {"progress": self.now - self.last, "arrived": 0.0}

    def solved(self, player):
        super().solved(player)  # no return


class TermMissing(East):
    def reward(self, player):
        return {"progress": 0.0}


class TermOfZeros(East):
    def reward(self, player):
        return {**super().reward(player), "arrived": 0.0}


class NeverPunished(East):
    def reward(self, player):
        return {**super().reward(player), "arrived": 0.0}


class SilentWorld(East):
    senses = ("audio",)


class NoGoal(East):
    solved = Task.solved

    def reward(self, player):
        return {"progress": self.now - self.last, "arrived": 1.0}


class FailsInReward(East):
    def reward(self, player):
        return {"progress": 1.0 / 0, "arrived": 0.0}


class FailsInBuild(East):
    def build(self):
        raise RuntimeError("no such furniture")


class WalksWest(EastExpert):
    def act(self, observation):
        x, y = self.player.body.forward[:2]
        return float(x < -0.5), float(np.clip(-3.0 * np.arctan2(-y, -x), -1.0, 1.0))


@pytest.fixture
def game_of(monkeypatch):
    """Return the configuration of a task that is registered for this test alone."""

    def chosen(task, expert=None):
        monkeypatch.setitem(TASKS._entries, task.__name__, task)
        if expert is not None:
            monkeypatch.setitem(EXPERTS._entries, task.__name__, expert)
        return replace(CHOSEN, task=EastCfg(name=task.__name__))

    return chosen


def starts(cfg):
    with closing(Game(cfg)) as game:
        return list(check_starts(game, 5, seed=0))


def random_play(cfg):
    with closing(Game(cfg)) as game:
        return list(check_random_play(game, 10, seed=0))


def returns(cfg):
    with closing(Game(cfg)) as game:
        return list(check_returns(game, 4, seed=0))


def seeding(cfg):
    with closing(Game(cfg)) as used, closing(Game(cfg)) as new:
        return list(check_seeding(used, new, 4, seed=0))


def test_a_sound_task_passes_every_check(game_of):
    report = check_game(game_of(East, EastExpert), CheckCfg(starts=5, steps=10, episodes=6))
    assert report.passed, report
    assert {finding.status for finding in report.findings} == {Status.passed}
    assert str(report).startswith("East: 12 passed, 0 failed, 0 skipped\npassed  build: players")
    assert "100%" in report["goal"].message
    with pytest.raises(KeyError, match=naming("'beauty'", "'build'")):
        report["beauty"]


@pytest.mark.parametrize(
    ("task", "check", "name", "pattern"),
    [
        (UnseededStart, seeding, "seeding", naming("used", "new")),
        (StateOfTheLastEpisode, seeding, "seeding", naming("used")),
        (FixedStart, seeding, "seeding", naming("seeds", " 0 ", " 1 ")),
        (FixedStart, starts, "starts", naming("5 starts", "reset(rng)")),
        (StartOutside, starts, "starts", r"\bagents\b.*\(50\.00, .*; \D*2\D*$"),
        (StartsInAThing, starts, "starts", r"\bagents\b.*\bcrate\b.* 1[5-7]. mm"),
        (EndsAtOnce, starts, "first step", naming("episode 0 ")),
        (SomeSolvedAtOnce, starts, "first step", r"\b[1-4]\b.*\b5 episodes\b.*\bagents\b"),
        (InfiniteTerm, random_play, "rewards", naming("'progress'", "agents", "nan")),
        (InfiniteTerm, returns, "reward terms", naming("'progress'", "agents", "nan")),
        (TooGreatForFloat32, random_play, "rewards", naming("'progress'", "agents", "1e+39")),
        (TooGreatForFloat32, returns, "reward terms", naming("'progress'", "agents", "1e+39")),
        (
            TermOfAnArray,
            random_play,
            "rewards",
            "^[^;]*'progress'[^;]*ndarray[^;]*$",
        ),
        (TooGreatWithItsWeight, random_play, "rewards", naming("reward", "agents", "1e+40")),
        (SolvedIsForgotten, random_play, "rewards", naming("solved()", "agents", "None")),
        (
            TermMissing,
            random_play,
            "rewards",
            naming("agents", "['progress']", "['arrived', 'progress']"),
        ),
        (SilentWorld, random_play, "no constant observation", naming("'audio'", "agents")),
    ],
)
def test_a_fault_is_reported(game_of, task, check, name, pattern):
    found = {finding.check: finding for finding in check(game_of(task))}
    assert found[name].status is Status.failed
    assert re.search(pattern, found[name].message), found[name].message


def test_a_goal_that_holds_from_the_start_on_is_no_fault_of_the_starts(game_of):
    assert {finding.status for finding in starts(game_of(AvoidsSomething))} == {Status.passed}
    _, _, goal = returns(game_of(AvoidsSomething, EastExpert))
    assert goal.status is Status.failed  # but the random policy reaches it too


def test_observations_that_do_not_fit_their_specs_are_reported(game_of, monkeypatch):
    with closing(Game(game_of(East))) as game:
        (sense,) = game.senses["agents"].values()
        (key,) = sense.specs
        good = sense.compute()[key]
        for wrong, parts in (
            (good[:-1], (good[:-1].shape, good.shape)),
            (good.astype(np.float64), ("float64", good.dtype)),
            (np.full_like(good, np.nan), ("finite",)),
        ):
            monkeypatch.setattr(sense, "compute", lambda wrong=wrong: {key: wrong.copy()})
            finding = next(check_random_play(game, 2, seed=0))
            assert finding.status is Status.failed
            assert re.search(naming(repr(key), *parts), finding.message)


def test_an_expert_that_is_worse_than_the_random_policy_is_reported(game_of):
    _, expert, goal = returns(game_of(East, WalksWest))
    assert (expert.status, goal.status) == (Status.failed, Status.failed)
    assert "difference -" in expert.message
    assert re.search(r"\b0%", goal.message)


def test_checks_of_what_a_task_does_not_have_are_skipped(game_of):
    assert [f.status for f in returns(game_of(NoGoal))[1:]] == [Status.skipped] * 2
    goal = returns(game_of(NoGoal, EastExpert))[2]
    assert goal.status is Status.skipped
    assert "solved()" in goal.message


def test_a_punishment_that_no_policy_earned_is_skipped(game_of):
    cfg = game_of(NeverPunished, EastExpert)
    cfg.task.weights["arrived"] = -1.0
    found = returns(cfg)[0]
    assert found.status is Status.skipped
    assert re.search(naming("'arrived'", "8 episodes", "progress"), found.message)


def test_a_reward_that_neither_the_expert_nor_the_random_policy_earned_is_a_failure(game_of):
    found = returns(game_of(TermOfZeros, EastExpert))[0]
    assert found.status is Status.failed
    assert re.search(naming("'arrived'", "8 episodes"), found.message)


def test_a_reward_that_the_random_policy_did_not_earn_is_skipped_without_an_expert(game_of):
    found = returns(game_of(TermOfZeros))[0]
    assert found.status is Status.skipped
    assert re.search(naming("'arrived'", "4 episodes", "expert"), found.message)


def test_beside_an_unreached_punishment_an_unreached_reward_is_a_failure(game_of):
    class Standing(NeverPunished):
        def reward(self, player):
            return {"progress": 0.0, "arrived": 0.0}

    cfg = game_of(Standing, EastExpert)
    cfg.task.weights["arrived"] = -1.0
    found = returns(cfg)[0]
    assert found.status is Status.failed
    assert re.search(naming("'progress'", "8 episodes"), found.message)
    assert "arrived" not in found.message


def test_an_expert_without_the_sense_that_it_needs_is_skipped():
    cfg = compose(["+task=KickTheBall", "senses/audio=deaf", "task.max_seconds=0.2"]).game
    for finding in returns(cfg)[1:]:
        assert finding.status is Status.skipped
        assert re.search(naming("expert", "audio"), finding.message)


def test_an_exception_of_the_task_is_reported_with_its_place(game_of):
    report = check_game(game_of(FailsInReward), QUICK)
    assert not report.passed
    assert report["build"].status is Status.passed
    for name in ("seeding", "first step", "rewards", "reward terms", "expert"):
        assert report[name].status is Status.failed
        assert report[name].message.startswith("ZeroDivisionError: ")
        assert "test_check_task.py" in report[name].message
        assert re.search(r"\breward\b", report[name].message)


@pytest.mark.parametrize(
    ("task", "parts"),
    [
        (FailsInBuild, ("RuntimeError", "no such furniture")),
        (EliminatesNobody, ("EliminatesNobody", "is_eliminated", "eliminates=False")),
        (TeamOfNobody, ("'red'", "TeamOfNobody", "size=0")),
    ],
)
def test_what_cannot_be_built_is_not_played(game_of, task, parts):
    report = check_game(game_of(task), QUICK)
    assert re.search(naming(*parts), report["build"].message)
    assert [f.check for f in report.failed] == ["build"]
    assert {f.status for f in report.findings[1:]} == {Status.skipped}


def test_classes_that_are_not_registered_and_impossible_numbers_are_refused():
    with pytest.raises(ValueError, match=naming("'East'", "@register_task")):
        veca_marl.check_task(East)
    with pytest.raises(ValueError, match=naming("episodes=1", "2")):
        CheckCfg(episodes=1)
    with pytest.raises(ValueError, match=naming("seed=-1")):
        CheckCfg(seed=-1)
