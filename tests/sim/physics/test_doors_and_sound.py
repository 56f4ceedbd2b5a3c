"""Closed doors attenuate sound at any width; open ones attenuate no path more than closed ones."""

import math

import numpy as np
import pytest
from refusals import naming
from seeking import shipped

from veca_marl.sim.geometry import Pose
from veca_marl.sim.physics import (
    DoorCfg,
    JointCfg,
    JointKind,
    LeafCfg,
    PartCfg,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    RoomCfg,
    WallsCfg,
    World,
)

LOSS_DB = 30.0
OPENINGS = (0.25, 0.5, 0.75, 1.0)
HINGE, SLIDE = LeafCfg(opening=0.0), LeafCfg(JointKind.slide, opening=0.0)


def flat(leaf=HINGE, width_m=1.0, walls=None, order=1):
    """Two rooms in a row along x with a door at (3.05, 1.4)."""
    rooms = [RoomCfg(f"room_{n}", (3.1 * n, 0.0, 0.0), (3.0, 3.0, 2.5)) for n in range(2)]
    door = DoorCfg("door", ("room_0", "room_1"), (3.05, 1.4), width_m, leaf)
    walls = walls or WallsCfg()
    return PlaygroundCfg("flat", rooms, [door], walls=walls, image_order=order)


@pytest.fixture
def build():
    worlds = []

    def build(playground):
        worlds.append(World(playground))
        return worlds[-1]

    yield build
    for world in worlds:
        world.close()


def losses_db(world, source, head):
    """Return the attenuation of all paths from a source to a head by what they pass, dB."""
    arrivals = world.house.arrivals(np.array(source), Pose(np.array(head), np.eye(3)))
    rooms = [world.house.room_of(np.array(point)) for point in (source, head)]
    walls = 1.0 if rooms[0] != rooms[1] else world.house._rooms[rooms[0]].gains
    return -20.0 * np.log10(arrivals.gains / walls)


def random_paths(count, seed=0):
    """Return ends of paths in the rooms of `flat`, ``(count, 2, 3)`` metres."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform((1.5, 0.1, 0.1), (4.6, 2.9, 2.4), (count, 2, 3))
    in_wall = np.abs(ends[..., 0] - 3.05) < 0.06
    ends[in_wall, 0] += 0.12
    return ends


def test_an_open_sliding_door_attenuates_no_path_through_its_wall_twice(build):
    """At x = 4 the open leaf of the kitchen of house2 stands in the wall."""
    world = build(shipped("house2"))
    leaf = world.prop("leaf_door_kitchen")
    for opening in (0.0, *OPENINGS):
        leaf.set_opening(opening)
        for x in (3.7, 4.0, 4.4):
            assert losses_db(world, (x, 2.0, 1.0), (x, 3.2, 1.0)) == pytest.approx([LOSS_DB])


@pytest.mark.parametrize("kind", JointKind)
@pytest.mark.parametrize("front", [True, False])
def test_an_open_door_attenuates_no_path_more_than_a_closed_one(build, kind, front):
    world = build(flat(LeafCfg(kind, opens_to_front=front, opening=0.0), width_m=0.9))
    leaf = world.prop("leaf_door")
    paths = random_paths(400)
    closed = [losses_db(world, *ends) for ends in paths]
    for opening in OPENINGS:
        leaf.set_opening(opening)
        opened = [losses_db(world, *ends) for ends in paths]
        assert all((now <= shut + 1e-9).all() for now, shut in zip(opened, closed, strict=True))
        assert any((now < shut - 1.0).any() for now, shut in zip(opened, closed, strict=True))


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
def test_source_and_listener_can_be_exchanged_at_any_opening(build, leaf):
    world = build(flat(leaf, order=0))
    paths = random_paths(300, seed=1)
    for opening in (0.0, *OPENINGS):
        world.prop("leaf_door").set_opening(opening)
        for one, other in paths:
            there, back = losses_db(world, one, other), losses_db(world, other, one)
            np.testing.assert_array_equal(there, back)


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
@pytest.mark.parametrize(
    ("width_m", "height_m"), [(1.0, 2.0), (0.6, 2.0), (0.3, 2.0), (1.0, 0.8), (0.3, 0.8)]
)
def test_a_closed_leaf_attenuates_at_any_size_and_an_open_one_does_not(
    build, leaf, width_m, height_m
):
    world = build(flat(leaf, width_m, WallsCfg(door_height_m=height_m)))
    door = world.prop("leaf_door")
    for aside in (-0.45, 0.0, 0.45):
        y = 1.4 + aside * (width_m - 0.04)
        ends = (2.5, y, 0.45), (3.6, y, 0.45)  # at the height of the handle
        door.set_opening(0.0)
        assert losses_db(world, *ends) == pytest.approx([LOSS_DB])
    door.set_opening(1.0)
    y = 1.4 - 0.45 * (width_m - 0.04) if leaf is SLIDE else 1.4
    assert losses_db(world, (2.5, y, 0.45), (3.6, y, 0.45)) == pytest.approx([0.0])


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
def test_oblique_paths_past_the_frame_pass_one_partition(build, leaf):
    """The wall and the edge of the closed leaf, with a gap of 1 cm between them."""
    world = build(flat(leaf))
    for y in np.linspace(0.7, 2.1, 141):
        for slope in (-1.0, -0.4, 0.4, 1.0):
            ends = (2.55, y - 0.5 * slope, 1.0), (3.55, y + 0.5 * slope, 1.0)
            assert losses_db(world, *ends).max() <= LOSS_DB + 1e-9


def test_a_door_that_is_half_open_attenuates_what_its_leaf_covers(build):
    world = build(flat(SLIDE))
    world.prop("leaf_door").set_opening(0.5)  # 0.43 m towards greater y
    for y, loss_db in ((1.0, 0.0), (1.25, 0.0), (1.4, LOSS_DB), (1.8, LOSS_DB), (2.1, LOSS_DB)):
        assert losses_db(world, (2.5, y, 1.0), (3.6, y, 1.0)) == pytest.approx([loss_db])
    ajar = build(flat(HINGE))  # the hinge is at y = 0.91
    ajar.prop("leaf_door").set_opening(0.25)
    for y, loss_db in ((1.1, LOSS_DB), (1.7, LOSS_DB), (1.88, 0.0)):
        assert losses_db(ajar, (2.5, y, 1.0), (3.6, y, 1.0)) == pytest.approx([loss_db])


def test_an_open_leaf_between_source_and_listener_in_one_room_is_no_partition(build):
    """It stands at y = 0.93, from x = 3.07 to 4.05."""
    world = build(flat(HINGE))
    ends = (3.6, 0.5, 1.0), (3.6, 1.4, 1.0)
    closed = losses_db(world, *ends)
    world.prop("leaf_door").set_opening(1.0)
    assert world.prop("leaf_door").bounds()[1][0] > 4.0
    np.testing.assert_array_equal(losses_db(world, *ends), closed)


def test_an_open_leaf_along_another_wall_does_not_add_to_it(build):
    """The leaf of the door at the corner lies along the wall between rooms 1 and 2."""
    rooms = [
        RoomCfg("room_0", (0.0, 0.0, 0.0), (3.0, 3.0, 2.5)),
        RoomCfg("room_1", (3.1, 0.0, 0.0), (3.0, 3.0, 2.5)),
        RoomCfg("room_2", (3.1, -3.1, 0.0), (3.0, 3.0, 2.5)),
    ]
    door = DoorCfg("door", ("room_0", "room_1"), (3.05, 0.55), 1.0, HINGE)
    world = build(PlaygroundCfg("flat", rooms, [door], walls=WallsCfg()))
    world.prop("leaf_door").set_opening(1.0)
    low, high = world.prop("leaf_door").bounds()
    assert high[0] > 4.0
    assert 0.0 < low[1] < high[1] < 0.15
    assert losses_db(world, (3.6, 0.6, 1.0), (3.6, -0.6, 1.0)) == pytest.approx([LOSS_DB])


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
def test_a_listener_in_the_doorway_hears_both_rooms(build, leaf):
    world = build(flat(leaf))
    world.prop("leaf_door").set_opening(1.0)
    for x in np.linspace(2.95, 3.15, 21):
        for source in ((1.5, 1.4, 1.0), (4.6, 1.4, 1.0)):
            assert losses_db(world, source, (x, 1.4, 1.0))[0] == 0.0


def test_a_leaf_that_is_placed_in_another_opening_closes_that_one(build):
    world = build(flat(HINGE))
    leaf = world.prop("leaf_door")
    x, y, z = leaf.position
    leaf.place((x, y + 5.0, z))
    assert losses_db(world, (2.5, 1.4, 1.0), (3.6, 1.4, 1.0)) == pytest.approx([0.0])
    leaf.place((x, y, z), math.pi)  # the hinge is on the other side now
    assert losses_db(world, (2.5, 1.4, 1.0), (3.6, 1.4, 1.0)) == pytest.approx([LOSS_DB])
    leaf.set_opening(1.0)
    assert losses_db(world, (2.5, 1.4, 1.0), (3.6, 1.4, 1.0)) == pytest.approx([0.0])


def test_a_reset_puts_leaf_and_opening_back(build):
    world = build(flat(HINGE))
    leaf, ends = world.prop("leaf_door"), ((2.5, 1.4, 1.0), (3.6, 1.4, 1.0))
    world.freeze()
    for _ in range(2):
        world.reset(np.random.default_rng(0))
        assert losses_db(world, *ends) == pytest.approx([LOSS_DB])
        leaf.place((9.0, 9.0, 1.0), 1.0)
        leaf.set_opening(1.0)
        assert losses_db(world, *ends) == pytest.approx([0.0])


def test_a_small_box_with_a_joint_that_is_no_partition_does_not_attenuate(build):
    """The flap of a cupboard, say, keeps the rule of furniture."""
    flap = PropCfg(
        "flap", PropShape.box, [0.04, 0.5, 0.9], (1.5, 1.5, 0.5), mass_kg=1.0, joint=JointCfg()
    )
    playground = flat(HINGE)
    playground.props.append(flap)
    world = build(playground)
    assert losses_db(world, (1.0, 1.5, 0.5), (2.0, 1.5, 0.5))[0] == 0.0


@pytest.mark.parametrize(
    "shape",
    [
        {"shape": PropShape.sphere, "size_m": [0.1]},
        {"shape": PropShape.compound, "parts": [PartCfg(PropShape.sphere, [0.1])]},
    ],
)
def test_a_partition_without_a_box_is_refused(shape):
    with pytest.raises(ValueError, match=naming("prop 'ball'", "partition=true", "box")):
        PropCfg("ball", partition=True, **shape)
