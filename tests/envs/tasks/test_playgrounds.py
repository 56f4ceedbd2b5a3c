"""Tasks that the paper runs in several playgrounds can be played in all of those that fit."""

import re

import numpy as np
import pytest
from composed import compose
from refusals import naming

from veca_marl.checks.starts import overlaps
from veca_marl.config import ConfigError
from veca_marl.config import compose as check_whole
from veca_marl.envs.core.game import Game
from veca_marl.envs.tasks.floors.playability import ROOMS

FURNISHED = [
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("house", "random_house")),
    "house2",
]


def play(task, playground, *overrides, resets=3, steps=2):
    """Play some steps of some episodes; return the game."""
    game = Game(compose([f"+task={task}", f"playground={playground}", *overrides]).game)
    for seed in range(resets):
        game.reset(np.random.default_rng(seed))
        for _ in range(steps):
            for player in game.players:
                player.body.rest()
            game.advance()
    return game


@pytest.mark.parametrize("task", ["KickTheBall", "GrabObject", "ObjectNav", "MultiAgentNav"])
@pytest.mark.parametrize("playground", FURNISHED)
def test_tasks_of_the_paper_are_played_in_furnished_houses(task, playground):
    game = play(task, playground)
    for seed in range(5):
        game.reset(np.random.default_rng(seed))
        for player in game.players:
            place = player.body.position
            room = min(game.cfg.playground.rooms, key=lambda room: room.distance_m(place[:2]))
            assert room.contains(np.array([*place[:2], 0.1]), margin_m=0.0)
        assert not overlaps(game), seed
    game.close()


@pytest.mark.parametrize("count", [1, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("task", ["KickTheBall", "ObjectNav", "MultiAgentNav", "ColorSort"])
def test_tasks_start_in_the_random_house_of_any_seed(task, count):
    for seed in np.random.default_rng(0).integers(0, 1_000_000, count).tolist():
        words = (f"playground.seed={seed}", "playground.leaves=0.5")
        game = play(task, "random_house", *words, resets=2, steps=0)
        assert not overlaps(game), seed
        game.close()


@pytest.mark.slow
def test_random_houses_without_loops_have_a_room_with_one_door():
    for seed in np.random.default_rng(1).integers(0, 1_000_000, 5).tolist():
        words = ["playground=random_house", f"playground.seed={seed}", "playground.loops=0"]
        house = compose(["+task=BabyzumasRevenge", *words]).playground
        doors = [room for door in house.doors for room in door.rooms]
        assert min(doors.count(room.name) for room in house.rooms) == 1


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            ["+task=KickTheBall", "playground.rooms=[{name: den, size_m: [2.0, 4.0, 2.6]}]"],
            ("KickTheBall", "'den'", "3.0 m", "playground=simple", "house2"),
        ),
        (
            ["+task=MultiAgentNav", "playground=single_room"],
            ("task.agents=", "'single_room'", "playground=two_rooms", "random_house"),
        ),
        (
            ["+task=SoccerOnePlayer", "playground=seven_rooms"],
            ("'seven_rooms'", "4.4 m", "task.ball_from_goal_m", "playground=simple"),
        ),
        (
            ["+task=SoccerTwoPlayer", "playground=single_room"],
            ("'single_room'", "'bed'", "goal", "playground=simple"),
        ),
        (
            ["+task=PushOut1v1", "playground=seven_rooms", "task.radius_m=1.6"],
            ("'seven_rooms'", "task.radius_m=1.6", "playground=simple", "single_room"),
        ),
        (
            ["+task=MultiAgentNav", "playground=house", "task.agents=5"],
            ("task.agents=5", "'house'", " 4", "playground=seven_rooms", "house2"),
        ),
        (
            ["+task=MultiAgentNav", "task.agents=9"],
            ("task.agents=9", "'seven_rooms'", " 7"),
        ),
        (
            ["+task=MultiAgentNav", "playground=simple"],
            ("'simple'", "playground=two_rooms", "playground.room_count=2"),
        ),
        (
            ["+task=GrabObject", "task.ahead_m=[4.0,8.0]"],
            ("GrabObject", "8.05 m", "task.ahead_m=(4.0, 8.0)", "6 x 6 m"),
        ),
        (
            ["+task=MoveToTarget", "task.target_m=[2.0,3.0]", "task.clip_m=4"],
            ("MoveToTarget", "3.05 m", "'simple'"),
        ),
        (
            ["+task=PileUpBlock", "task.blue_ahead_m=[2.9,3.0]"],
            ("PileUpBlock", "3.04 m"),
        ),
        (
            ["+task=PutDownBlock", "task.aside_m=[5,9]"],
            ("PutDownBlock", "9.04 m"),
        ),
        (
            ["+task=RotateCube", "playground.rooms=[{lower_m: [1.0, 1.0, 0.0]}]"],
            ("RotateCube", "0.6 m", "playground=simple"),
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_the_configuration(words, parts):
    with pytest.raises(ConfigError, match=naming(*parts)):
        compose(words)


@pytest.mark.parametrize(
    "task", ["TurnBaby", "SitBaby", "CrawlBaby", "RunBaby", "SelfTouch", "HandRegard"]
)
def test_a_room_that_is_too_small_to_lie_in_is_refused_in_the_configuration(task):
    room = "playground.rooms=[{name: den, size_m: [1.9, 4.0, 2.6]}]"
    with pytest.raises(ConfigError, match=naming(task, " 2 m ", "'den'", "1.9 x 4 m")):
        compose([f"+task={task}", room])


def test_more_agents_than_any_playground_has_rooms_are_told_how_many_fit():
    named = naming("task.agents=9", "playground=seven_rooms", "house2", " 7")
    with pytest.raises(ConfigError, match=named):
        check_whole(["+task=MultiAgentNav", "playground=simple", "task.agents=9"])


@pytest.mark.slow
@pytest.mark.parametrize("agents", [5, 6, 7])
def test_the_playgrounds_that_are_offered_to_more_agents_can_be_composed(agents):
    with pytest.raises(ConfigError) as refusal:
        check_whole(["+task=MultiAgentNav", "playground=two_rooms", f"task.agents={agents}"])
    offered = re.findall(r"playground=\w+(?: playground\.\w+=\w+)*", str(refusal.value))
    assert any("seven_rooms" in choice for choice in offered)
    for choice in offered:
        check_whole(["+task=MultiAgentNav", f"task.agents={agents}", *choice.split()])


@pytest.mark.parametrize("playground", ROOMS)
def test_the_playgrounds_that_are_offered_have_so_many_rooms(playground):
    cfg = compose(["+task=KickTheBall", f"playground={playground}"]).game.playground
    assert len(cfg.rooms) == ROOMS[playground]


@pytest.mark.parametrize("task", ["CrawlBaby", "TurnBaby"])
def test_bodies_on_the_floor_start_beside_furniture(task):
    game = Game(compose([f"+task={task}", "playground=single_room"]).game)
    for seed in range(15):
        game.reset(np.random.default_rng(seed))
        assert not overlaps(game), seed
    game.close()
