"""ChaseCar: presses, contacts, the verb that a body needs, exploits, the expert."""

import math

import numpy as np
import pytest
import started
from composed import compose
from refusals import naming

from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.sim.body.walker import WalkCommand

NUMB = "senses/touch=numb"


def game_of(*overrides):
    return started.game_of("ChaseCar", NUMB, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


def act(game, forward=0.0, turn=0.0, verb="none"):
    """Simulate a step; return the outcome, the terms of the player among it."""
    player = game.players[0]
    player.body.act(player.body.encode(WalkCommand(forward, turn, verb=verb)))
    outcome = game.advance()
    return outcome, outcome.terms[player.name]


def face(game, way_m, car_yaw_rad=0.0):
    """Put the car in front of the player, driving away from it."""
    game.task.walker.place((-1.0, 0.0, 0.0))
    game.task.car.prop.place((-1.0 + way_m, 0.0, 0.08), car_yaw_rad)
    game.world.refresh()


# ---- presses


@pytest.mark.parametrize(("way_m", "pressed"), [(0.85, 1.0), (1.3, 0.0)])
def test_a_press_counts_within_the_range_of_the_body(game, way_m, pressed):
    game.reset(np.random.default_rng(0))
    face(game, way_m)
    outcome, terms = act(game, verb="press")
    assert terms == {"pressed": pressed, "hit": 0.0}
    assert game.reward_of(terms) == pressed
    assert not outcome.done


def test_a_car_behind_the_player_cannot_be_pressed(game):
    game.reset(np.random.default_rng(0))
    face(game, 0.8)
    game.task.walker.place((-1.0, 0.0, 0.0), math.pi)
    game.world.refresh()
    assert act(game, verb="press")[1]["pressed"] == 0.0


def test_without_the_verb_nothing_counts(game):
    game.reset(np.random.default_rng(0))
    face(game, 0.8)
    assert act(game)[1]["pressed"] == 0.0


def test_presses_count_once_per_rest_and_the_last_one_solves_the_task():
    game = game_of("task.presses=2", "task.rest_s=0.4")
    seen = []
    while not seen or not seen[-1].done:
        face(game, 0.8)
        seen.append(act(game, verb="press")[0])
    counted = [outcome.terms["agents"]["pressed"] for outcome in seen]
    assert counted == [1.0] + [0.0] * 9 + [1.0]
    assert seen[-1].terminated
    assert game.task.solved(game.players[0])
    assert not seen[-2].solved["agents"]
    game.close()


def test_a_contact_ends_the_episode_unsolved(game):
    game.reset(np.random.default_rng(0))
    face(game, 0.22, math.pi / 2.0)
    outcome, terms = act(game, forward=1.0, verb="press")
    assert outcome.terminated
    assert terms["hit"] == 1.0
    assert terms["pressed"] == 0.0
    assert not game.task.solved(game.players[0])


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("body.verbs=[grab]", ("body.verbs=['grab']", "['press']")),
        ("task.presses=0", ("task.presses=0",)),
        ("task.rest_s=0", ("task.rest_s",)),
        ("playground=four_rooms", ("'four_rooms'", "playground=simple", "single_room")),
    ],
)
def test_what_cannot_be_played_is_refused(override, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        Game(compose(["+task=ChaseCar", override]).game)


def test_both_kinds_of_moves_have_the_verb_beside_them(game):
    assert set(game.players[0].body.action_spec) == {"move", "verb"}
    discrete = game_of("body.action=discrete")
    spec = discrete.players[0].body.action_spec
    assert spec["move"].is_discrete
    assert spec["verb"].names == ("none", "press")
    discrete.close()


# ---- policies


def test_the_car_drives_away_from_the_player(game):
    """It is farther away than random points of the room are, 3 m in the mean from a corner."""
    away_m = []
    for seed in range(6):
        game.reset(np.random.default_rng(seed))
        game.task.walker.place((-2.0, -2.0, 0.0))
        for step in range(250):
            act(game)
            if step > 75:
                away_m.append(math.dist(game.task.car.prop.position[:2], (-2.0, -2.0)))
    assert np.mean(away_m) > 3.2


def play(game, policy, seeds):
    """Return the share of solved episodes."""
    solved = 0
    for seed in seeds:
        game.reset(np.random.default_rng(seed))
        done = False
        while not done:
            done = policy(game).done
        solved += bool(game.task.solved(game.players[0]))
    return solved / len(seeds)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("forward", "turn"), [(0.0, 0.0), (0.0, 0.3), (0.0, 1.0)], ids=["stand", "turn slowly", "spin"]
)
def test_pressing_all_the_time_without_chasing_seldom_solves_the_task(game, forward, turn):
    assert play(game, lambda game: act(game, forward, turn, verb="press")[0], range(12)) <= 0.5


def expert(game):
    game.play_script(game.players[0], Script.expert)
    return game.advance()


def test_the_expert_presses_and_does_not_touch():
    game = game_of("task.presses=2")
    assert play(game, expert, range(100, 102)) == 1.0
    game.close()


@pytest.mark.slow
def test_the_expert_solves_most_episodes(game):
    assert play(game, expert, range(200, 230)) >= 0.9
