"""MultiAgentNav: starts, rewards, houses, voices and experts."""

import math

import numpy as np
import pytest
from babies import zero_action
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.experts.control.locomotion import locomotion_of
from veca_marl.envs.experts.control.path_following import PathFollower
from veca_marl.envs.tasks.navigation.multi_agent_nav import MultiAgentNavCfg, Muted
from veca_marl.envs.tasks.navigation.places import gap_m
from veca_marl.envs.tasks.player_starts import place_player
from veca_marl.sim.sound import CALLS, Call, call_waveform

STEP_S = 0.04
EARS_ALONE = ("senses/vision=blind", "senses/touch=numb")
REACH_M = 0.6  # from the middle of the object: its radius and the task's reach


def game_of(*overrides, agents=2, playground="four_rooms"):
    overrides = [f"task.agents={agents}", f"playground={playground}", *overrides]
    return Game(compose(["+task=MultiAgentNav", *EARS_ALONE, *overrides]).game)


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


def begin(game, seed=0):
    """Start with all agents far from the object, which is in the middle of a room."""
    game.reset(np.random.default_rng(seed))
    game.task.target.place((0.0, 0.0, 0.2))
    for n, player in enumerate(game.players):
        player.body.place((4.0, 3.0 + 0.6 * n, 0.0))
    game.world.refresh()


def step(game, **commands):
    """Simulate one step; agents without a command stand."""
    commands = {player.name: commands.get(player.name, (0.0, 0.0)) for player in game.players}
    rows = {player.name: player.body.encode(commands[player.name]) for player in game.players}
    return game.step(rows)


def put(game, number, x, y=0.0, yaw_deg=0.0):
    game.players[number].body.place((x, y, 0.0), math.radians(yaw_deg))
    game.world.refresh()


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


def test_the_start_is_free_and_at_rest(game):
    for seed in range(10):
        game.reset(np.random.default_rng(seed))
        before = [player.body.position[:2] for player in game.players]
        before.append(game.task.target.position[:2])
        step(game)
        after = [player.body.position[:2] for player in game.players]
        after.append(game.task.target.position[:2])
        np.testing.assert_allclose(after, before, atol=1e-6)
        for place in after[:-1]:
            assert math.dist(place, after[-1]) > REACH_M


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


def test_the_weights_are_those_of_the_paper():
    assert MultiAgentNavCfg().weights == {"reached": 1.0, "ahead": 0.05, "turn": 0.03}


def moved(game, yaw_deg, *commands):
    """Move 1.5 m east of the object; return the helper terms ``(steps, 2)``."""
    begin(game)
    put(game, 0, 1.5, yaw_deg=yaw_deg)
    step(game)
    name, other = [player.name for player in game.players]
    found = []
    for command in commands:
        terms = step(game, **{name: command}).terms
        found.append([terms[name]["ahead"], terms[name]["turn"]])
        assert (terms[other]["ahead"], terms[other]["turn"]) == (0.0, 0.0)
    return np.array(found)


def walked(game, yaw_deg, forward=1.0):
    return tuple(moved(game, yaw_deg, (forward, 0.0))[0])


@pytest.mark.parametrize("forward", [0.0, 1.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_turning_towards_a_visible_object_is_rewarded(game, side, forward):
    """The object is 20 degrees to the left (side=1) or right."""
    towards = moved(game, 180.0 - 20.0 * side, (forward, side))[0, 1]
    away = moved(game, 180.0 - 20.0 * side, (forward, -side))[0, 1]
    assert towards > 0.03
    assert away < -0.03


def test_turning_to_and_fro_in_front_of_the_object_adds_nothing(game):
    turns = moved(game, 170.0, *[(0.0, side) for side in (1.0, 1.0, -1.0, -1.0) * 4])[:, 1]
    assert np.abs(turns).sum() > 0.3
    assert abs(turns.sum()) < 1e-3


def test_turning_round_adds_at_most_one_step_of_turning(game):
    """The object leaves the images on one side and enters them on the other."""
    turned_rad = abs(moved(game, 170.0, (0.0, 1.0))[0, 1])
    steps = round(2.0 * math.pi / turned_rad)
    turns = moved(game, 180.0, *[(0.0, 1.0)] * steps)[:, 1]
    assert np.abs(turns).sum() > 0.5
    assert abs(turns.sum()) <= 1.01 * turned_rad


def test_the_helper_reward_is_in_metres_while_the_object_is_visible(game):
    np.testing.assert_allclose(walked(game, 180.0), (STEP_S, 0.0), atol=1e-4)
    assert walked(game, 165.0)[0] == pytest.approx(STEP_S, abs=1e-4)
    assert walked(game, 180.0, forward=-1.0)[0] == pytest.approx(-0.3 * STEP_S, rel=0.01)


def test_the_helper_reward_is_0_while_the_object_is_not_visible(game):
    assert walked(game, 0.0) == (0.0, 0.0)
    begin(game)
    put(game, 0, 2.5, -1.0, yaw_deg=160.0)
    step(game)
    name = game.players[0].name
    assert step(game, **{name: (1.0, 0.0)}).terms[name]["ahead"] == 0.0


@pytest.mark.parametrize("vision", ["binocular", "blind"])
def test_players_see_the_target_with_their_own_eyes(vision):
    """The target is 15 degrees to the side, outside of the images of a narrow preset."""
    game = game_of(f"senses/vision={vision}", "senses.vision.fov_deg=6")
    begin(game)
    put(game, 0, 1.5, yaw_deg=165.0)
    finder = game.players[0]
    step(game, **{finder.name: (0.0, 0.0)})
    assert ("vision" in game.observe(finder)) == (vision == "binocular")
    assert game.task.sees_target(finder) is (vision == "blind")
    game.close()


def test_the_object_is_visible_through_a_door(game):
    begin(game)
    game.task.target.place((0.5, 0.9, 0.2))
    put(game, 0, 3.0, 0.9, yaw_deg=180.0)
    step(game)
    name = game.players[0].name
    assert step(game, **{name: (1.0, 0.0)}).terms[name]["ahead"] == pytest.approx(STEP_S, rel=0.01)


def test_the_helper_reward_is_0_after_the_arrival(game):
    begin(game)
    put(game, 0, 0.62, yaw_deg=180.0)
    step(game)
    name = game.players[0].name
    assert step(game, **{name: (1.0, 0.0)}).terms[name]["ahead"] == 0.0
    assert game.task.arrived == {name}


# ---- numbers of agents and playgrounds


@pytest.mark.parametrize(
    ("playground", "agents"),
    [
        ("two_rooms", 2),
        ("three_rooms", 3),
        ("seven_rooms", 4),
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


@pytest.mark.parametrize(("playground", "rooms"), [("single_room", 1), ("three_rooms", 3)])
def test_more_agents_than_rooms_are_refused(playground, rooms):
    wrong = rf"task.agents={rooms + 1} .* playground '{playground}' has {rooms}; choose"
    with pytest.raises(ValueError, match=wrong):
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
        loud.append(game.observe(other)["audio"].max())
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


# ---- experts and voices


def seconds_needed(game, seed):
    """Let the experts play; return the time until all have arrived, inf if they have not."""
    rng = np.random.default_rng(seed)
    game.reset(rng)
    while True:
        commands = {p.name: game.expert_of(p).act(game.observe(p)) for p in game.players}
        outcome = game.step({p.name: p.body.encode(commands[p.name]) for p in game.players})
        if outcome.done:
            return game.steps * STEP_S if outcome.terminated else math.inf


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
