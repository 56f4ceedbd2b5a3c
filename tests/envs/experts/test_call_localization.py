"""CallSourceMap: localization of callers in a house from two ears."""

import math

import numpy as np
import pytest
from composed import compose

from veca_marl.envs.core.game import Game
from veca_marl.envs.experts.multi_agent_nav import CallSourceMap, loudness, sound_power
from veca_marl.envs.tasks.floors.places import free_place
from veca_marl.sim.sound import Call

STEPS = 10


@pytest.fixture(scope="module")
def game():
    shut = ("senses/vision=blind", "senses/touch=numb")
    made = Game(compose(["+task=MultiAgentNav", *shut]).game)
    yield made
    made.close()


def heard(game, call_map, listener, caller, call=Call.high):
    """Update the map of a listener, at x, y and yaw, with the calls of a caller."""
    ears, mouth = game.players
    ears.body.place((*listener[:2], 0.0), math.radians(listener[2]))
    mouth.body.place((*caller, 0.0), 0.0)
    for _ in range(STEPS):
        commands = {ears.name: (0.0, 0.0), mouth.name: (0.0, 0.0, call)}
        game.step({p.name: p.body.encode(commands[p.name]) for p in game.players})
        audio, _ = [game.observe(player).get("audio") for player in game.players]
    call_map.update(ears.body.mount("head"), audio)


@pytest.fixture
def call_map(game):
    game.reset(np.random.default_rng(0))
    for player in game.players:
        game.observe(player)
    return CallSourceMap(game.world)


def test_silence_leaves_the_map_unchanged(game, call_map):
    heard(game, call_map, (0.0, 0.0, 0.0), (1.0, 0.0), Call.none)
    assert not call_map.heard


@pytest.mark.parametrize(
    ("listener", "caller"),
    [
        ((-1.0, 0.0, 0.0), (-0.2, 1.0)),  # ahead to the left; what is behind is another room
        ((1.0, -1.0, 90.0), (0.5, 1.0)),
    ],
)
def test_a_call_is_localized_with_several_headings(game, call_map, listener, caller):
    """One heading leaves open whether a call comes from the front or from behind."""
    x, y, yaw_deg = listener
    for turned_deg in (0.0, 40.0, 80.0):
        heard(game, call_map, (x, y, yaw_deg + turned_deg), caller)
    away_m = math.dist((x, y), caller)
    assert math.dist(call_map.best()[:2], caller) < 0.4 + 0.25 * away_m


@pytest.mark.slow
def test_calls_from_other_rooms_are_localized_better_than_by_chance(game):
    """They arrive round the edges of doors and with the reflections of both rooms."""
    rng, errors = np.random.default_rng(0), []
    rooms = game.task.plan.rooms
    for _ in range(30):
        game.reset(rng)
        listener, caller = (
            free_place(rooms[n], [], 0.5, rng) for n in rng.choice(len(rooms), 2, replace=False)
        )
        for player in game.players:
            game.observe(player)
        call_map = CallSourceMap(game.world)
        for turned_deg in (0.0, 40.0, 80.0):
            heard(game, call_map, (*listener[:2], turned_deg), tuple(caller[:2]))
        chance = np.mean([math.dist(place[:2], caller[:2]) for place in call_map._places])
        errors.append(math.dist(call_map.best()[:2], caller[:2]) / chance)
    assert np.median(errors) < 0.6


@pytest.mark.slow
def test_the_later_of_two_callers_is_localized(game, call_map):
    for caller in ((0.5, 0.8), (-0.5, -1.0)):
        for yaw_deg in np.linspace(0.0, 720.0, 40):
            heard(game, call_map, (0.0, 0.0, yaw_deg), caller)
    assert math.dist(call_map.best()[:2], (-0.5, -1.0)) < 0.6


def test_loudness_is_the_root_of_the_energy():
    audio = np.full((2, 250), -np.inf)
    audio[0, [3, 200]] = math.log10(3.0), math.log10(4.0)
    audio[1, 7] = 2.0
    np.testing.assert_allclose(loudness(sound_power(audio)), (math.log10(5.0), 2.0))


@pytest.fixture(scope="module")
def noisy_game():
    shut = ("senses/vision=blind", "senses/touch=numb", "senses.audio.noise_floor_db=-80")
    made = Game(compose(["+task=MultiAgentNav", *shut]).game)
    yield made
    made.close()


@pytest.fixture
def noisy_map(noisy_game):
    noisy_game.reset(np.random.default_rng(0))
    for player in noisy_game.players:
        noisy_game.observe(player)
    ears = noisy_game.players[0].senses["audio"]
    return CallSourceMap(noisy_game.world, ears.noise_power)


def test_the_noise_of_the_receivers_is_no_call(noisy_game, noisy_map):
    heard(noisy_game, noisy_map, (0.0, 0.0, 0.0), (1.0, 0.0), Call.none)
    assert not noisy_map.heard


def test_a_call_is_localized_beside_noise(noisy_game, noisy_map):
    for turned_deg in (0.0, 40.0, 80.0):
        heard(noisy_game, noisy_map, (-1.0, 0.0, turned_deg), (-0.2, 1.0))
    assert math.dist(noisy_map.best()[:2], (-0.2, 1.0)) < 0.8


def test_the_expert_takes_the_noise_of_its_receivers_into_account(noisy_game):
    noisy_game.reset(np.random.default_rng(0))
    player = noisy_game.players[0]
    expert = noisy_game.expert_of(player)
    expert.act(noisy_game.observe(player))
    assert not expert._search._calls.heard
