"""MultiAgentNav: houses, bodies, voices and experts."""

import math

import numpy as np
import pytest
from babies import zero_action
from refusals import naming
from seekers import STEP_S, game_of, seconds_needed

from veca_marl.envs.experts.control.locomotion import locomotion_of, walk_to
from veca_marl.envs.experts.control.path_following import PathFollower, detours_in
from veca_marl.envs.tasks.floors.places import place_player
from veca_marl.envs.tasks.navigation.multi_agent_nav import Muted
from veca_marl.sim.sound import CALLS, Call, call_waveform


@pytest.mark.parametrize(
    ("playground", "agents"),
    [
        ("two_rooms", 2),
        pytest.param("three_rooms", 3, marks=pytest.mark.slow),
        pytest.param("seven_rooms", 4, marks=pytest.mark.slow),
        pytest.param("house", 2, marks=pytest.mark.slow),
        pytest.param("house2", 3, marks=pytest.mark.slow),
        pytest.param("random_house", 2, marks=pytest.mark.slow),
    ],
)
def test_the_experts_solve_every_house(playground, agents):
    game = game_of("task.max_seconds=40", agents=agents, playground=playground)
    assert [player.team for player in game.players] == ["seekers"] * agents
    assert math.isfinite(seconds_needed(game, seed=1))
    game.close()


@pytest.mark.slow
def test_an_expert_behind_the_leaf_of_an_open_door_walks_round_it():
    game = game_of("task.max_seconds=20", playground="house2")
    game.reset(np.random.default_rng(0))
    leaf = game.world.prop("leaf_door_bathroom")
    inside, outside = game.players
    place_player(inside, np.array([-3.6, 2.6, 0.0]), 0.0)
    place_player(outside, np.array([-2.0, 3.6, 0.0]), 0.0)
    game.task.target.place(np.array([0.0, 3.6, 0.2]))
    path = PathFollower(
        inside.body,
        locomotion_of(inside, game.world.clock.step_s),
        game.task.plan,
        game.world.clock.step_s,
        detours_in(game.world, 0.2),
    )
    rest = outside.body.encode(walk_to(outside.body, outside.body.position))
    hall = game.task.plan.room_of(game.task.target.position)
    while path.room != hall:
        command = path.to(game.task.target.position)
        rows = {inside.name: inside.body.encode(command), outside.name: rest}
        assert not game.step(rows).done
    assert leaf.opening > 0.9
    game.close()


@pytest.mark.parametrize(("playground", "rooms"), [("single_room", 1), ("three_rooms", 3)])
def test_more_agents_than_rooms_are_refused(playground, rooms):
    named = naming(f"task.agents={rooms + 1}", f"'{playground}'", f" {rooms}")
    with pytest.raises(ValueError, match=named):
        game_of(agents=rooms + 1, playground=playground)


def test_joint_level_bodies_can_play_and_are_heard():
    game = game_of("body=mitten")
    game.reset(np.random.default_rng(0))
    one, other = game.players
    game.observe(other)
    one.body.place((0.0, 0.0, 0.5))
    other.body.place((1.5, 0.0, 0.5))
    rest = {p.name: zero_action(p.body) for p in game.players}
    loud = []
    for sounds in ([], [call_waveform(CALLS[Call.high], 22_050)]):
        for sound in sounds:
            one.body.make_sound(sound)
        outcome = game.step(rest)
        loud.append(game.observe(other)["audio"][:2].max())
        assert set(outcome.terms[one.name]) == {"reached", "ahead", "turn"}
    assert loud[1] > loud[0] + 3.0
    game.close()


def test_the_expert_of_a_joint_level_body_crawls_to_a_visible_object_and_calls():
    game = game_of("body=mitten_voice", "senses/touch=numb", "task.max_seconds=30")
    rng = np.random.default_rng(0)
    game.reset(rng)
    finder, other = game.players
    assert finder.body.bone("chest").forward[2] < -0.8
    room = game.task.plan.rooms[0]
    place_player(finder, room.middle_m - np.array([0.8, 0.0, 0.0]), 0.0)
    place_player(other, game.task.plan.rooms[2].middle_m, 0.0)
    game.task.target.place(room.middle_m + np.array([0.7, 0.0, 0.2]))
    called = False
    while finder.name not in game.task.arrived:
        heard, _ = [game.observe(player) for player in game.players]
        command = game.expert_of(finder).act(heard)
        rest = zero_action(other.body)
        rows = {finder.name: finder.body.encode(command), other.name: rest}
        called = called or rows[finder.name]["voice"] == Call.high
        assert not game.step(rows).done
    assert called
    game.close()


@pytest.mark.slow  # one room and a wall: the tests before and after it
@pytest.mark.parametrize("body", ["mitten_voice", "full_voice"])
def test_the_experts_on_hands_and_knees_solve_a_house(body):
    game = game_of(f"body={body}", "task.max_seconds=90", playground="seven_rooms")
    assert math.isfinite(seconds_needed(game, seed=1))
    game.close()


@pytest.mark.slow
def test_a_crawling_path_follower_recovers_from_a_wall():
    """On hands and knees with the head against a wall, the body first has to move backwards."""
    game = game_of("body=mitten_voice", playground="two_rooms")
    rng = np.random.default_rng(0)
    game.reset(rng)
    player, other = game.players
    low, size = game.task.plan.rooms[0].lower_m, game.task.plan.rooms[0].size_m
    place_player(player, (low[0] + 0.55, low[1] + size[1] / 2.0), math.pi)
    goal = np.array([low[0] + 2.0, low[1] + size[1] / 2.0])
    legs = locomotion_of(player, STEP_S)
    traveller = PathFollower(player.body, legs, game.task.plan, STEP_S)
    still = zero_action(other.body)
    for _ in range(25 * 25):
        row = player.body.encode(traveller.to(goal))
        game.step({player.name: row, other.name: still})
        if traveller.is_at(goal):
            break
    assert traveller.is_at(goal)
    game.close()


@pytest.mark.slow
def test_the_experts_are_deterministic():
    times = []
    for _ in range(2):
        game = game_of(agents=3)
        times.append(seconds_needed(game, seed=5))
        game.close()
    assert times[0] == times[1] < math.inf


def test_muted_agents_depend_on_the_starting_rooms():
    voices = {}
    for muted in Muted:
        game = game_of(f"task.muted={muted.value}", agents=3)
        game.reset(np.random.default_rng(2))
        home = game.task.plan.room_of(game.task.target.position)
        voices[muted] = {
            game.task.plan.room_of(player.body.position) == home: player.body.muted
            for player in game.players
        }
        game.close()
    assert voices == {
        Muted.none: {True: False, False: False},
        Muted.finder: {True: True, False: False},
        Muted.seekers: {True: False, False: True},
        Muted.all: {True: True, False: True},
    }


@pytest.mark.slow  # which agents are muted: test_muted_agents_depend_on_the_starting_rooms
def test_the_experts_fail_more_often_without_the_voice_of_the_finder():
    """From the same starts; see experiments/calling for the full measurement."""
    times = {}
    for muted in (Muted.none, Muted.finder):
        game = game_of(f"task.muted={muted.value}", playground="seven_rooms")
        times[muted] = np.array([seconds_needed(game, seed) for seed in range(6)])
        game.close()
    assert np.isfinite(times[Muted.none]).all()
    assert np.isinf(times[Muted.finder]).sum() >= 3
