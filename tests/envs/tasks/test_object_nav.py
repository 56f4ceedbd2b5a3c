"""ObjectNav and ObjectPhysNav: placement, rewards, end of an episode, exploits, experts."""

import math

import numpy as np
import pytest
import started
from composed import compose
from refusals import naming

from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import Script
from veca_marl.envs.tasks.floors.places import clearances_m, furniture_of
from veca_marl.envs.tasks.navigation.object_nav import ObjectKind

SMALL_EYES = ("senses.vision.width=16", "senses.vision.height=16")
REACH_M = 0.3


def game_of(*overrides):
    return started.game_of("ObjectNav", *SMALL_EYES, *overrides)


@pytest.fixture(scope="module")
def game():
    game = game_of()
    yield game
    game.close()


def put(game, gap, of=None, facing_deg=180.0):
    """Put the agent east of an object, at a distance from its surface; the others far away."""
    game.reset(np.random.default_rng(0))
    objects = [game.task.target, *game.task.wrong]
    target = objects[0] if of is None else of
    for number, prop in enumerate(objects):
        prop.place((0.0, 0.0, 0.15) if prop is target else (-2.5, number - 1.0, 0.15))
    x = target.radius_m + REACH_M + gap
    game.players[0].body.place((x, 0.0, 0.0), math.radians(facing_deg))
    walk(game)  # the helper reward compares the states before and after a step


def walk(game, forward=0.0, turn=0.0):
    return game.step({"agents": np.array([forward, turn], np.float32)})


# ---- placement


@pytest.mark.parametrize("playground", ["simple", "single_room", "seven_rooms"])
def test_objects_and_start_keep_their_distances(playground):
    game = game_of(f"playground={playground}")
    targets = []
    for seed in range(60):
        game.task.reset(np.random.default_rng(seed))
        objects = [game.task.target, *game.task.wrong]
        places = [game.players[0].body.position, *(prop.position for prop in objects)]
        apart = [math.dist(a[:2], b[:2]) for n, a in enumerate(places) for b in places[:n]]
        assert min(apart) >= 1.2 - 1e-6
        furniture = [p for p in furniture_of(game.world) if p not in objects]
        assert all(clearances_m(prop, place[:2]) >= 0.5 for place in places for prop in furniture)
        targets.append(game.task.target.position[:2])
    assert np.ptp(targets, axis=0).min() > 3.0
    game.close()


def test_the_target_is_of_the_configured_kind():
    game = game_of("task.target=cube", "task.objects=[cylinder,cube,cylinder]")
    colours = {prop.name: prop.cfg.colour for prop in [game.task.target, *game.task.wrong]}
    blue = colours.pop(game.task.target.name)
    assert blue[2] > 0.8
    assert len(colours) == 2
    assert all(colour[1] > 0.6 for colour in colours.values())
    game.close()


def test_no_two_kinds_have_a_shape_or_a_colour_in_common_and_all_stand_on_the_floor():
    game = game_of(f"task.objects={[kind.name for kind in ObjectKind]}")
    objects = [game.task.target, *game.task.wrong]
    assert len({prop.cfg.shape for prop in objects}) == len(ObjectKind) == 5
    assert len({prop.cfg.colour for prop in objects}) == 5
    for prop in objects:
        assert prop.lowest_m == pytest.approx(0.0, abs=0.02)
        assert 0.09 <= prop.radius_m <= 0.25
    game.close()


def test_a_playground_without_space_is_an_error_that_names_it():
    with pytest.raises(ValueError, match=naming("'seven_rooms'", " 4 ", "9.00 m")):
        compose(["+task=ObjectNav", "playground=seven_rooms", "task.apart_m=9"])


def test_nothing_is_reached_at_the_start_with_the_least_distance():
    game = game_of("task.reach_m=0.8", "task.apart_m=1.0")
    for seed in range(40):
        game.reset(np.random.default_rng(seed))
        assert not walk(game).terminated
    game.close()


# ---- rewards and the end of an episode


@pytest.mark.parametrize(("gap", "reached"), [(-0.01, True), (0.01, False)])
def test_the_target_is_reached_at_a_distance_from_its_surface(game, gap, reached):
    put(game, gap)
    outcome = walk(game)
    assert outcome.terms["agents"]["reached"] == float(reached)
    assert outcome.terms["agents"]["wrong"] == 0.0
    assert outcome.terminated is reached
    assert game.task.solved(game.players[0]) is reached


def test_a_wrong_object_ends_the_episode_unsolved(game):
    for wrong in game.task.wrong:
        put(game, -0.01, of=wrong)
        outcome = walk(game)
        assert (outcome.terms["agents"]["reached"], outcome.terms["agents"]["wrong"]) == (0.0, 1.0)
        assert outcome.terminated
        assert not game.task.solved(game.players[0])
        assert game.reward_of(outcome.terms["agents"]) == pytest.approx(-1.0, abs=0.01)


def test_the_helper_reward_counts_visible_displacement_to_the_target(game):
    put(game, 1.0)
    assert walk(game, forward=1.0).terms["agents"]["ahead"] == pytest.approx(0.04, rel=0.01)
    put(game, 1.0, facing_deg=0.0)
    assert walk(game, forward=1.0).terms["agents"]["ahead"] == 0.0
    put(game, 1.0, of=game.task.wrong[0], facing_deg=90.0)
    assert walk(game, forward=1.0).terms["agents"]["ahead"] == 0.0


@pytest.mark.parametrize(("turn", "expected"), [(1.0, 1.0), (-1.0, -1.0)])
def test_turning_towards_the_visible_target_is_rewarded(game, turn, expected):
    put(game, 1.0, facing_deg=160.0)
    turned_rad = walk(game, turn=turn).terms["agents"]["turn"]
    assert turned_rad == pytest.approx(expected * math.radians(120.0) * 0.04, rel=0.01)


def shuttle_return(game):
    """Return of an agent that walks towards the target, turns round, walks back, and so on."""
    put(game, 2.5)
    total = 0.0
    legs = [(55, 1.0, 0.0), (38, 0.0, 1.0), (55, 1.0, 0.0), (38, 0.0, 1.0)]
    while True:
        for steps, forward, turn in legs:
            for _ in range(steps):
                outcome = walk(game, forward, turn)
                total += game.reward_of(outcome.terms["agents"])
                if outcome.done:
                    return total


def test_going_to_and_fro_in_front_of_the_target_is_no_substitute_for_reaching_it(game):
    """Only the way there is rewarded: the target is not visible on the way back."""
    assert 0.1 < shuttle_return(game) < 0.5


def test_standing_still_has_no_return(game):
    put(game, 1.0)
    assert sum(game.reward_of(walk(game).terms["agents"]) for _ in range(100)) == 0.0


# ---- experts and bodies


def solved_by(game, script, seeds):
    solved = 0
    for seed in seeds:
        game.reset(np.random.default_rng(seed))
        done = False
        while not done:
            game.play_script(game.players[0], script)
            done = game.advance().done
        solved += bool(game.task.solved(game.players[0]))
    return solved


@pytest.mark.parametrize("playground", ["simple", "single_room"])
def test_the_expert_reaches_the_target(playground):
    game = game_of(f"playground={playground}")
    assert solved_by(game, Script.expert, range(8)) == 8
    game.close()


def test_a_walker_with_discrete_moves_can_play():
    game = game_of("body=walker_discrete")
    assert solved_by(game, Script.expert, range(2)) == 2
    game.close()


def test_object_phys_nav_is_object_nav_on_hands_and_knees():
    game = Game(compose(["+task=ObjectPhysNav", *SMALL_EYES, "senses/touch=numb"]).game)
    game.reset(np.random.default_rng(0))
    game.players[0].body.place((0.0, 0.0, 0.5))
    game.task.target.place((0.6, 0.0, 0.15))
    game.world.refresh()
    game.players[0].body.rest()
    outcome = game.advance()
    assert outcome.terms["agents"]["reached"] == 1.0
    assert outcome.terminated
    game.close()


@pytest.mark.slow  # three minutes of crawling
def test_the_crawling_expert_reaches_the_target():
    game = Game(compose(["+task=ObjectPhysNav", *SMALL_EYES, "senses/touch=numb"]).game)
    assert solved_by(game, Script.expert, range(4)) >= 3
    game.close()
