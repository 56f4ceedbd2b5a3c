"""Sound and sight follow the rooms and doors of furnished houses."""

import numpy as np
import pytest
from refusals import naming
from seeking import shipped

from veca_marl.sim.body.walker import Walker, WalkerCfg
from veca_marl.sim.hearing import AudioCfg, AudioSense
from veca_marl.sim.physics import (
    DoorCfg,
    LeafCfg,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    RandomHouseCfg,
    RoomCfg,
    World,
)
from veca_marl.sim.sound import Call
from veca_marl.sim.vision import is_visible

MOUTH_M = 0.6
LOSS_DB = 30.0
DOOR = (3.05, 1.2)  # of `house`, between the living room and the kitchen
ACROSS = (np.array([-0.3, -0.3, 0.0]), np.array([0.3, 0.3, 0.0]))  # through any door
AWAY = (30.0, 30.0, 1.0)


def extras():
    leaf = PropCfg("leaf", PropShape.box, [0.04, 1.0, 2.0], AWAY)
    return [leaf, PropCfg("toy", PropShape.sphere, [0.15], (4.5, 1.2, 0.15))]


@pytest.fixture(scope="module")
def kitchen_door():
    """The living room of `house` with a walker in it, one in the kitchen, a leaf and a toy."""
    playground = shipped("house")
    playground.props += extras()
    world = World(playground)
    walkers = [Walker(name, WalkerCfg(), world) for name in ("speaker", "friend")]
    ears = AudioSense(AudioCfg(waveform=True), walkers[1], world)
    world.freeze()
    yield world, *walkers, ears
    world.close()


def close(world):
    world.prop("leaf").place((*DOOR, 1.0))


def loudest(scene, y, closed=False):
    """The greatest sample that the walker in the kitchen hears of a call from the living room."""
    world, speaker, friend, ears = scene
    world.reset(np.random.default_rng(0))
    ears.reset()
    if closed:
        close(world)
    speaker.place((2.0, y, 0.0))
    friend.place((4.1, y, 0.0), np.pi)
    speaker.call(Call.high)
    heard = []
    for _ in range(8):
        world.step()
        heard.append(np.abs(ears.read()["waveform"]).max())
    return max(heard)


def decibels(ratio):
    return 20.0 * np.log10(ratio)


def test_a_call_from_the_next_room_arrives_through_the_door(kitchen_door):
    open_door, wall = loudest(kitchen_door, 1.2), loudest(kitchen_door, 0.3)
    # 0.4 m behind the edge of the opening, round which it comes
    assert 8.0 < decibels(open_door / wall) < LOSS_DB


def test_a_closed_leaf_attenuates_a_call(kitchen_door):
    open_door, leaf = loudest(kitchen_door, 1.2), loudest(kitchen_door, 1.2, closed=True)
    assert decibels(open_door / leaf) == pytest.approx(LOSS_DB, abs=4.0)


@pytest.mark.parametrize(
    ("toy", "closed", "visible"),
    [
        ((4.5, 1.2), False, True),  # straight through the door
        ((4.5, 1.2), True, False),
        ((4.5, -0.4), False, False),  # behind the wall
        ((2.0, 2.0), False, True),  # in the same room
    ],
)
def test_a_toy_is_seen_through_an_open_door_only(kitchen_door, toy, closed, visible):
    world, looker, other, _ = kitchen_door
    world.reset(np.random.default_rng(0))
    if closed:
        close(world)
    world.prop("toy").place((*toy, 0.15))
    other.place((-1.0, -1.0, 0.0))
    looker.place((0.5, 1.2, 0.0), yaw_rad=np.arctan2(toy[1] - 1.2, toy[0] - 0.5))
    world.refresh()
    assert is_visible(world.scene, looker, world.prop("toy")) is visible


@pytest.mark.parametrize("playground", ["house", "house2", 0, 7])
def test_doors_are_openings_for_sound_and_the_walls_beside_and_above_are_not(playground):
    named = isinstance(playground, str)
    cfg = shipped(playground) if named else RandomHouseCfg(seed=playground)
    world = World(cfg)
    rooms = {room.name: room for room in cfg.rooms}
    for door in cfg.doors:
        centre = np.array([*door.position_m, MOUTH_M])
        one, other = (rooms[name] for name in door.rooms)
        low, far = np.array(one.lower_m[:2]), np.array(other.lower_m[:2])
        gaps = np.maximum(far - low - one.size_m[:2], low - far - other.size_m[:2])
        normal = np.zeros(3)
        normal[int(np.argmax(gaps))] = 0.2
        along = normal[[1, 0, 2]] / 0.2
        for shift, is_open in (
            (0.0 * along, True),
            ((door.width_m / 2 - 0.2) * along, True),  # beside an open leaf
            ((door.width_m / 2 + 0.1) * along, False),
            (np.array([0.0, 0.0, 1.6]), False),
        ):
            middle = centre + shift
            at_8_khz = world.house.direct_energy(middle - normal, middle + normal)[-1]
            assert at_8_khz > 0.5 if is_open else at_8_khz < 0.1, (door.name, shift)
    world.close()


def test_the_leaves_of_a_house_are_open_and_close_the_doors_for_sound():
    world = World(shipped("house2"))
    world.freeze()
    world.reset(np.random.default_rng(0))
    leaves = [door for door in world.playground.doors if door.leaf is not None]
    assert len(leaves) == 4
    for door in leaves:
        leaf = world.prop(f"leaf_{door.name}")
        assert leaf.opening == pytest.approx(1.0, abs=0.01)
        ends = [np.array([*door.position_m, MOUTH_M]) + each for each in ACROSS]
        assert world.house.direct_energy(*ends)[-1] > 0.5
        leaf.set_opening(0.0)
        assert world.house.direct_energy(*ends)[-1] < 0.01
    world.close()


def test_a_leaf_needs_walls():
    door = DoorCfg("door", ("a", "b"), (3.05, 1.0), leaf=LeafCfg())
    rooms = [RoomCfg("a", (0.0, 0.0, 0.0), (3.0, 3.0, 2.5)), RoomCfg("b", (3.1, 0.0, 0.0))]
    with pytest.raises(ValueError, match=naming("'door'", "leaf", "walls")):
        PlaygroundCfg("flat", rooms, [door])
    with pytest.raises(ValueError, match=naming("opening=2")):
        LeafCfg(opening=2)
