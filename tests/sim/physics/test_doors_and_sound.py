"""Closed doors attenuate sound at any width; open ones no path between rooms more than that."""

import math

import numpy as np
import pytest
from refusals import naming
from seeking import shipped

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
AT_500_HZ = 2
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


def loss_db(world, source, head, band=AT_500_HZ):
    """Return what the direct sound from a source to a head loses by what it passes, dB."""
    left = world.house.direct_energy(np.array(source, float), np.array(head, float))
    return -10.0 * np.log10(left[band])


def random_paths(count, seed=0):
    """Return ends of paths in the rooms of `flat`, ``(count, 2, 3)`` metres."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform((1.5, 0.1, 0.1), (4.6, 2.9, 2.4), (count, 2, 3))
    in_wall = np.abs(ends[..., 0] - 3.05) < 0.06
    ends[in_wall, 0] += 0.12
    return ends


def test_an_open_sliding_leaf_in_its_wall_adds_its_mass_at_most(build):
    """At x = 4 the open leaf of the kitchen of house2 stands in the wall."""
    world = build(shipped("house2"))
    leaf = world.prop("leaf_door_kitchen")
    for opening in (0.0, *OPENINGS):
        leaf.set_opening(opening)
        for x in (4.0, 4.4):
            # 6 dB by the mass law, less what comes round the frame of the open door
            assert LOSS_DB - 18.0 < loss_db(world, (x, 2.0, 1.0), (x, 3.2, 1.0)) < LOSS_DB + 6.5


@pytest.mark.parametrize("kind", JointKind)
@pytest.mark.parametrize("front", [True, False])
def test_an_open_door_attenuates_most_paths_less_than_a_closed_one(build, kind, front):
    world = build(flat(LeafCfg(kind, opens_to_front=front, opening=0.0), width_m=0.9))
    leaf = world.prop("leaf_door")
    one, other = random_paths(200).swapaxes(0, 1)
    one[:, 0], other[:, 0] = np.minimum(one[:, 0], 2.9), np.maximum(other[:, 0], 3.2)
    closed = [loss_db(world, *ends) for ends in zip(one, other, strict=True)]
    for opening in OPENINGS:
        leaf.set_opening(opening)
        opened = [loss_db(world, *ends) for ends in zip(one, other, strict=True)]
        gained = np.subtract(closed, opened)
        assert gained.max() > 3.0
        # the open leaf is a screen of its own for some paths through the wall
        assert gained.min() > -15.0
        assert np.mean(gained < -0.5) < 0.3
    assert np.median(gained) > 6.0


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
def test_source_and_listener_can_be_exchanged_at_any_opening(build, leaf):
    world = build(flat(leaf, order=0))
    paths = random_paths(100, seed=1)
    for opening in (0.0, *OPENINGS):
        world.prop("leaf_door").set_opening(opening)
        for one, other in paths:
            there, back = loss_db(world, one, other), loss_db(world, other, one)
            assert there == pytest.approx(back, abs=1e-5)


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
@pytest.mark.parametrize(
    ("width_m", "height_m"), [(1.0, 2.0), (0.6, 2.0), (0.3, 2.0), (1.0, 0.8), (0.3, 0.8)]
)
def test_a_closed_leaf_attenuates_at_any_size_and_an_open_one_hardly(
    build, leaf, width_m, height_m
):
    world = build(flat(leaf, width_m, WallsCfg(door_height_m=height_m)))
    door = world.prop("leaf_door")
    for aside in (-0.45, 0.0, 0.45):
        y = 1.4 + aside * (width_m - 0.04)
        ends = (2.5, y, 0.45), (3.6, y, 0.45)  # at the height of the handle
        door.set_opening(0.0)
        # the frame and the leaf that it overlaps have twice the mass
        assert LOSS_DB - 1.0 < loss_db(world, *ends) < LOSS_DB + 6.5
    door.set_opening(1.0)
    y = 1.4 - 0.25 * (width_m - 0.04) if leaf is SLIDE else 1.4
    at_8_khz = loss_db(world, (2.5, y, 0.45), (3.6, y, 0.45), -1)
    assert at_8_khz < (4.0 if width_m > 0.5 else 12.0)  # 12 cm of a sliding leaf stay in it


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
def test_oblique_paths_past_the_frame_pass_one_partition(build, leaf):
    """The wall and the edge of the closed leaf, with a gap of 1 cm between them."""
    world = build(flat(leaf))
    for y in np.linspace(0.7, 2.1, 36):
        for slope in (-1.0, -0.4, 0.4, 1.0):
            ends = (2.55, y - 0.5 * slope, 1.0), (3.55, y + 0.5 * slope, 1.0)
            assert loss_db(world, *ends) < LOSS_DB + 6.5


def test_a_door_that_is_half_open_attenuates_what_its_leaf_covers(build):
    world = build(flat(SLIDE))
    world.prop("leaf_door").set_opening(0.5)  # 0.43 m towards greater y
    free, covered = ([loss_db(world, (2.5, y, 1.0), (3.6, y, 1.0)) for y in ys]
                     for ys in ((1.0, 1.1), (1.6, 1.8, 2.1)))  # fmt: skip
    assert max(free) + 3.0 < min(covered)
    assert max(covered) < LOSS_DB + 6.5


def test_an_open_leaf_between_source_and_listener_in_one_room_is_a_screen(build):
    """It stands at y = 0.93, from x = 3.07 to 4.05."""
    world = build(flat(HINGE))
    ends = (3.6, 0.5, 1.0), (3.6, 1.4, 1.0)
    assert loss_db(world, *ends) < 0.01
    world.prop("leaf_door").set_opening(1.0)
    assert world.prop("leaf_door").bounds()[1][0] > 4.0
    assert 3.0 < loss_db(world, *ends) < LOSS_DB - 6.0


@pytest.mark.parametrize("leaf", [HINGE, SLIDE])
def test_a_listener_in_the_doorway_hears_both_rooms(build, leaf):
    world = build(flat(leaf))
    world.prop("leaf_door").set_opening(1.0)
    for x in np.linspace(2.95, 3.15, 21):
        for source in ((1.5, 1.3, 1.0), (4.6, 1.3, 1.0)):
            assert loss_db(world, source, (x, 1.3, 1.0)) < 2.0


def test_a_leaf_that_is_placed_in_another_opening_closes_that_one(build):
    world = build(flat(HINGE))
    leaf = world.prop("leaf_door")
    ends = (2.5, 1.4, 1.0), (3.6, 1.4, 1.0)
    x, y, z = leaf.position
    leaf.place((x, y + 5.0, z))
    assert loss_db(world, *ends) < 2.0
    leaf.place((x, y, z), math.pi)  # the hinge is on the other side now
    assert loss_db(world, *ends) == pytest.approx(LOSS_DB, abs=1.0)
    leaf.set_opening(1.0)
    assert loss_db(world, *ends) < 2.0


def test_a_reset_puts_leaf_and_opening_back(build):
    world = build(flat(HINGE))
    leaf, ends = world.prop("leaf_door"), ((2.5, 1.4, 1.0), (3.6, 1.4, 1.0))
    world.freeze()
    for _ in range(2):
        world.reset(np.random.default_rng(0))
        assert loss_db(world, *ends) == pytest.approx(LOSS_DB, abs=1.0)
        leaf.place((9.0, 9.0, 1.0), 1.0)
        leaf.set_opening(1.0)
        assert loss_db(world, *ends) < 2.0


@pytest.mark.parametrize(("height_m", "least_db"), [(0.2, 0.0), (0.9, 2.0)])
def test_a_box_with_a_joint_that_is_no_partition_is_furniture(build, height_m, least_db):
    """The flap of a cupboard, say: small ones attenuate nothing, large ones as screens."""
    flap = PropCfg(
        "flap", PropShape.box, [0.04, 0.5, height_m], (1.5, 1.5, 0.5), mass_kg=1.0,
        joint=JointCfg(),
    )  # fmt: skip
    playground = flat(HINGE)
    playground.props.append(flap)
    loss = loss_db(build(playground), (1.0, 1.5, 0.5), (2.0, 1.5, 0.5))
    assert loss == 0.0 if least_db == 0.0 else least_db < loss < 15.0


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
