"""Many in one world: every sense exists per agent, and all sense each other."""

import numpy as np
import pytest
from walking import box, empty_world, walker_in

from veca_marl.bench.free_play import free_play
from veca_marl.config import compose
from veca_marl.envs.core.actions import random_action
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.game_cfg import GameCfg
from veca_marl.sim.body import VoiceKind
from veca_marl.sim.body.anatomy.skeleton import load_skeleton
from veca_marl.sim.senses import SensesCfg, make_senses
from veca_marl.sim.touch import load_taxels

SENSES = ("vision", "audio", "touch", "proprioception")
STEPS = 12


def company(listening, silent_guest=False):
    """Let two walk and call; return the bytes that those who listen perceive, by sense."""
    world = empty_world(box("stool", mass_kg=8.0), box("toy", position=(0.5, 0.5, 0.15)))
    walkers = [
        walker_in(world, name, (x, 0.0, 0.0), yaw, voice=VoiceKind.calls)
        for name, x, yaw in (("one", -1.0, 0.0), ("two", 2.0, 180.0))
    ]
    if silent_guest:
        walkers.append(walker_in(world, "guest", (15.0, 15.0, 0.0), voice=VoiceKind.calls))
    senses = {w.name: make_senses(w, SENSES, SensesCfg(), world) for w in walkers}
    senses = {name: senses[name] for name in listening}
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
def alone():
    return company(["one"])["one"]


def test_nobody_perceives_otherwise_because_another_perceives_too(alone):
    for listening in (["one", "two"], ["two", "one"]):
        assert company(listening)["one"] == alone


def test_two_perceive_differently(alone):
    other = company(["two"])["two"]
    for sense in SENSES:
        assert other[sense] != alone[sense], sense


def test_a_guest_who_is_silent_and_out_of_sight_changes_no_hearing(alone):
    assert company(["one"], silent_guest=True)["one"]["audio"] == alone["audio"]


def test_two_equal_worlds_give_all_agents_the_same_bytes():
    game = compose(["+task=KickTheBall", "body=walker_voice"]).game
    with free_play(3, game.task, SENSES) as task:
        cfg = GameCfg(task, game.playground, game.body, game.senses, game.clock)
        first, second = (played(cfg) for _ in range(2))
    assert first.keys() == second.keys()
    assert len(first) == len(set(first.values())) == 3
    assert first == second


def played(cfg):
    """Play by random rows; return what each player perceived, as bytes."""
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


def perceived(sense, place):
    """What `one` at the origin perceives of `two` at a place, and of one who calls there."""
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
        observed = senses[sense].read()[sense]
    world.close()
    return observed


def test_each_sees_the_other():
    before, behind = perceived("vision", (1.0, 0.0, 0.0)), perceived("vision", (-1.0, 0.0, 0.0))
    assert (before != behind).mean() > 0.05


def test_each_hears_the_other():
    near, far = perceived("audio", (1.0, 0.0, 0.0)), perceived("audio", (8.0, 0.0, 0.0))
    assert (near[:, 4] - far[:, 4]).min() > 0.5  # the bin of 86 Hz; 9 times as far


def test_each_feels_the_other():
    """Shoulder to shoulder; the arm on that side feels it, the other does not."""
    apart = perceived("touch", (0.0, 3.0, 0.0)).reshape(1648, 6)
    beside = perceived("touch", (0.0, 0.22, 0.0)).reshape(1648, 6)
    felt = np.abs(beside - apart).max(axis=1) > 0.01
    owner = np.repeat(np.arange(47), np.diff(load_taxels().first_triangle))
    bones = {load_skeleton().bones[bone].name for bone in owner[felt]}
    assert {name for name in bones if name.startswith("l_")}
    assert not {name for name in bones if name.startswith("r_")}
