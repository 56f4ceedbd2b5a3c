"""MultiAgentNav: starts and arrivals."""

import math

import numpy as np
import pytest
from refusals import naming
from seekers import STEP_S, begin, game_of, put, step

from veca_marl.checks.starts import overlaps
from veca_marl.envs.tasks.floors.places import gap_m

REACH_M = 0.6  # from the middle of the object: its radius and the task's reach


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


@pytest.fixture(scope="module")
def crowd():
    game = game_of(agents=4)
    yield game
    game.close()


def reached(outcome):
    return [terms["reached"] for terms in outcome.terms.values()]


# ---- starts


def test_agents_start_in_separate_rooms_and_the_object_in_one_of_them(crowd):
    plan, homes = crowd.task.plan, set()
    for seed in range(40):
        crowd.reset(np.random.default_rng(seed))
        rooms = [plan.room_of(player.body.position) for player in crowd.players]
        assert sorted(rooms) == [0, 1, 2, 3]
        homes.add(rooms.index(plan.room_of(crowd.task.target.position)))
        assert crowd.task.arrived == set()
    assert homes == {0, 1, 2, 3}


def test_two_agents_start_in_any_two_rooms_the_object_with_one_of_them(game):
    plan, pairs = game.task.plan, set()
    for seed in range(40):
        game.reset(np.random.default_rng(seed))
        pair = tuple(plan.room_of(player.body.position) for player in game.players)
        assert plan.room_of(game.task.target.position) in pair
        pairs.add(pair)
    assert {one for one, _ in pairs} == {0, 1, 2, 3}
    assert all(one != other for one, other in pairs)


def test_agents_start_free_and_out_of_reach_and_nothing_pushes_them(game):
    for seed in range(10):
        game.reset(np.random.default_rng(seed))
        assert not overlaps(game)
        before = [player.body.position[:2] for player in game.players]
        step(game)
        after = [player.body.position[:2] for player in game.players]
        np.testing.assert_allclose(after, before, atol=1e-6)
        assert all(math.dist(place, game.task.target.position[:2]) > REACH_M for place in after)


@pytest.mark.parametrize("agents", [2, 7])
def test_starts_are_found_in_small_furnished_rooms(agents):
    """A furnished room of 3 x 3 m holds the object and the agent that starts beside it."""
    game = game_of(agents=agents, playground="seven_rooms")
    gaps = []
    for seed in range(400):
        game.task.reset(np.random.default_rng(seed))
        gaps += [gap_m(player.body.position, game.task.target) for player in game.players]
    assert min(gaps) >= 0.8
    game.close()


def test_a_separate_finder_starts_in_the_room_of_the_object():
    game = game_of("task.separate_finder=true", agents=3)
    assert [(player.team, player.name) for player in game.players] == [
        ("finder", "finder"),
        ("seekers", "seekers_0"),
        ("seekers", "seekers_1"),
    ]
    plan, homes = game.task.plan, set()
    for seed in range(20):
        game.reset(np.random.default_rng(seed))
        home = plan.room_of(game.task.target.position)
        rooms = [plan.room_of(player.body.position) for player in game.players]
        assert [room == home for room in rooms] == [True, False, False]
        homes.add(home)
    assert homes == {0, 1, 2, 3}
    game.close()


def test_a_separate_finder_has_the_same_share_in_the_reward():
    game = game_of("task.separate_finder=true")
    begin(game)
    put(game, 0, 0.5)
    assert reached(step(game)) == [1.0, 1.0]
    game.close()


@pytest.mark.parametrize(
    ("overrides", "parts"),
    [
        (
            ["body.radius_m=0.6", "body.capsule_height_m=1.5", "task.reach_m=0.8"],
            ("door", "width_m=1", "seekers_0", "body.radius_m=0.6"),
        ),
        (
            ["body.capsule_height_m=2.2"],
            ("walls.door_height_m=2", "seekers_0", "body.capsule_height_m=2.2"),
        ),
    ],
)
def test_bodies_that_do_not_fit_through_the_doors_are_refused(overrides, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        game_of(*overrides, playground="house")


# ---- reward and termination


def test_each_arrival_is_rewarded_once_for_all_agents(crowd):
    begin(crowd)
    assert reached(step(crowd)) == [0.0] * 4
    put(crowd, 2, 0.5)
    assert reached(step(crowd)) == [1.0] * 4
    assert reached(step(crowd)) == [0.0] * 4
    put(crowd, 2, 1.5)
    assert reached(step(crowd)) == [0.0] * 4
    put(crowd, 2, 0.5)
    assert reached(step(crowd)) == [0.0] * 4


def test_simultaneous_arrivals_add_up_and_the_last_arrival_terminates(crowd):
    begin(crowd)
    put(crowd, 0, 0.5)
    put(crowd, 1, -0.5)
    outcome = step(crowd)
    assert reached(outcome) == [2.0] * 4
    assert not outcome.done
    put(crowd, 2, 0.0, 0.5)
    assert not step(crowd).done
    put(crowd, 0, 1.5)  # it was there: that is enough
    put(crowd, 3, 0.0, -0.5)
    outcome = step(crowd)
    assert reached(outcome) == [1.0] * 4
    assert outcome.terminated


@pytest.mark.parametrize(("away_m", "arrived"), [(REACH_M - 0.01, True), (REACH_M + 0.01, False)])
def test_the_reach_is_measured_to_the_surface(game, away_m, arrived):
    begin(game)
    put(game, 0, away_m)
    assert reached(step(game)) == [float(arrived)] * 2


def test_the_episode_is_truncated(game):
    begin(game)
    steps = round(game.task.cfg.max_seconds / STEP_S)
    outcomes = [step(game) for _ in range(steps)]
    assert not any(outcome.done for outcome in outcomes[:-1])
    assert outcomes[-1].truncated
    assert not outcomes[-1].terminated
