"""Several agents in one world: each has senses of its own, and they perceive each other."""

import numpy as np
import pytest
from composed import compose
from walking import box, empty_world, walker_in

from veca_marl.bench.command import free_play
from veca_marl.envs.core.game import Game, random_action
from veca_marl.sim.body import VoiceKind
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.senses import SensesCfg, make_senses
from veca_marl.sim.touch import load_taxels

SENSES = ("vision", "audio", "touch", "proprioception")
STEPS = 12


def observed_bytes(observers, silent_guest=False):
    """Let two agents walk and call; return the bytes that the observers perceive, by sense."""
    world = empty_world(box("stool", mass_kg=8.0), box("toy", position=(0.5, 0.5, 0.15)))
    walkers = [
        walker_in(world, name, (x, 0.0, 0.0), yaw, voice=VoiceKind.calls)
        for name, x, yaw in (("one", -1.0, 0.0), ("two", 2.0, 180.0))
    ]
    if silent_guest:
        walkers.append(walker_in(world, "guest", (15.0, 15.0, 0.0), voice=VoiceKind.calls))
    senses = {w.name: make_senses(w, SENSES, SensesCfg(), world) for w in walkers}
    senses = {name: senses[name] for name in observers}
    world.freeze()
    world.reset(np.random.default_rng(0))
    for index, walker in enumerate(walkers):
        place = ((-1.0, 0.0, 0.0), (2.0, 0.1, 0.0), (15.0, 15.0, 0.0))[index]
        walker.place(place, (0.0, 3.1, 0.0)[index])
    world.refresh()
    seen = {}
    for step in range(STEPS + 1):
        if step:
            for index, walker in enumerate(walkers):
                move = np.array([(0.9, 0.7, 0.0)[index], 0.1])
                walker.act({"move": move, "voice": np.array((2, 1, 0)[index])})
            world.step()
        for name, of_one in senses.items():
            for sense, organ in of_one.items():
                parts = seen.setdefault(name, {}).setdefault(sense, [])
                parts.extend(value.tobytes() for value in organ.read().values())
    world.close()
    return seen


@pytest.fixture(scope="module")
def one_alone():
    return observed_bytes(["one"])["one"]


def test_observations_do_not_depend_on_the_observations_of_others(one_alone):
    for observers in (["one", "two"], ["two", "one"]):
        assert observed_bytes(observers)["one"] == one_alone


def test_two_agents_observe_differently(one_alone):
    other = observed_bytes(["two"])["two"]
    for sense in SENSES:
        assert other[sense] != one_alone[sense], sense


def test_a_silent_agent_out_of_sight_does_not_change_hearing(one_alone):
    assert observed_bytes(["one"], silent_guest=True)["one"]["audio"] == one_alone["audio"]


def test_two_equal_worlds_give_the_same_bytes():
    game = compose(["+task=KickTheBall", "body=walker_voice"]).game
    with free_play(game, 3, senses=SENSES) as cfg:
        first, second = (played(cfg) for _ in range(2))
    assert first.keys() == second.keys()
    assert len(first) == len(set(first.values())) == 3
    assert first == second


def played(cfg):
    """Play random actions; return the observations of each player as bytes."""
    game, rng = Game(cfg), np.random.default_rng(3)
    game.reset(rng)
    seen = {player.name: b"" for player in game.players}
    for step in range(STEPS + 1):
        if step:
            game.step({p.name: random_action(p.body.action_spec, rng) for p in game.players})
        for player in game.players:
            values = game.observe(player).values()
            seen[player.name] += b"".join(value.tobytes() for value in values)
    game.close()
    return seen


def observed(sense, place):
    """Return an observation of `one` at the origin with `two` at a place, which makes a sound."""
    world = empty_world()
    one, two = walker_in(world, "one"), walker_in(world, "two", place, 180.0)
    senses = make_senses(one, (sense,), SensesCfg(), world)
    world.freeze()
    world.reset(np.random.default_rng(0))
    one.place((0.0, 0.0, 0.0))
    two.place(place, np.pi)
    world.refresh()
    senses[sense].read()
    two.make_sound(0.1 * np.sin(np.arange(2000) * 0.1).astype(np.float32))
    for _ in range(2):
        world.step()
        value = senses[sense].read()[sense]
    world.close()
    return value


def test_agents_see_each_other():
    before, behind = observed("vision", (1.0, 0.0, 0.0)), observed("vision", (-1.0, 0.0, 0.0))
    assert (before != behind).mean() > 0.05


def test_agents_hear_each_other():
    near, far = observed("audio", (1.0, 0.0, 0.0)), observed("audio", (8.0, 0.0, 0.0))
    assert (near[:, 4] - far[:, 4]).min() > 0.5  # the bin of 86 Hz; 9 times as far


def test_agents_touch_each_other():
    """Shoulder to shoulder: only the arm on that side has contacts."""
    apart = observed("touch", (0.0, 3.0, 0.0)).reshape(1648, 6)
    beside = observed("touch", (0.0, 0.22, 0.0)).reshape(1648, 6)
    felt = np.abs(beside - apart).max(axis=1) > 0.01
    owner = np.repeat(np.arange(47), np.diff(load_taxels().first_triangle))
    bones = {load_skeleton().bones[bone].name for bone in owner[felt]}
    assert {name for name in bones if name.startswith("l_")}
    assert not {name for name in bones if name.startswith("r_")}
