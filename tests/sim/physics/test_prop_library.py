"""Doors, cupboards, chests, toys and pieces: they stand still, open, and fit into each other."""

import math

import numpy as np
import pytest
from refusals import naming
from walking import empty_world, let_pass, wall

from veca_marl.sim.physics import LockCfg
from veca_marl.sim.physics.props.containers import basket, chest, cupboard_with_drawer
from veca_marl.sim.physics.props.doors import door_leaf, sliding_leaf
from veca_marl.sim.physics.props.toys import ToyKind, fraction_piece, key, toy


def assert_at_rest(world, seconds=1.0):
    """Nothing moves by more than 3 mm from where it was put."""
    before = {name: prop.position for name, prop in world.props.items()}
    let_pass(world, seconds)
    for name, prop in world.props.items():
        assert np.linalg.norm(prop.position - before[name]) < 0.003, name


@pytest.mark.parametrize("kind", ToyKind)
def test_a_toy_stands_still_on_the_floor(kind):
    world = empty_world(toy("toy", kind, (0.3, 0.1)))
    assert_at_rest(world)
    assert world.prop("toy").rotation[2, 2] > 0.99


@pytest.mark.parametrize("to_front", [True, False])
def test_a_door_opens_to_the_side_that_was_asked_for(to_front):
    # an opening of 0.9 m in a wall of 0.1 m
    beside = [
        wall(f"wall {y}", length_m=1.0, position=(1.0, y, 0.0), yaw_deg=90.0) for y in (-0.95, 0.95)
    ]
    leaf = door_leaf("door", (1.0, 0.0), 0.0, 0.9, opens_to_front=to_front)
    world = empty_world(*beside, leaf)
    leaf = world.prop("door")
    assert_at_rest(world, 0.4)
    leaf.open()
    let_pass(world, 1.2)
    assert leaf.opening == 1.0
    assert (leaf.position[0] > 1.3) if to_front else (leaf.position[0] < 0.7)
    leaf.close()
    let_pass(world, 1.2)
    assert leaf.opening == 0.0


@pytest.mark.parametrize(("to_left", "side"), [(True, 1.0), (False, -1.0)])
def test_a_sliding_door_moves_into_the_wall_and_back(to_left, side):
    # an opening of 0.9 m in a wall of 0.1 m
    names = {-1.0: "right", 1.0: "left"}
    beside = [
        wall(name, length_m=1.0, position=(1.0, y * 0.95, 0.0), yaw_deg=90.0)
        for y, name in names.items()
    ]
    leaf = sliding_leaf("door", (1.0, 0.0), 0.0, 0.9, wall=names[side], slides_to_left=to_left)
    world = empty_world(*beside, leaf)
    leaf = world.prop("door")
    assert_at_rest(world, 0.4)
    leaf.open()
    let_pass(world, 1.2)
    assert leaf.opening == 1.0
    low, high = leaf.bounds()
    inner = -high[1] if side < 0 else low[1]  # its edge in the opening
    assert inner == pytest.approx(0.45 - 0.13, abs=0.01)
    assert leaf.position == pytest.approx((1.0, side * 0.76, 1.0), abs=0.002)
    leaf.close()
    let_pass(world, 1.2)
    assert leaf.opening == 0.0
    assert_at_rest(world, 0.4)


def test_a_locked_drawer_opens_with_its_key_and_moves_what_lies_in_it():
    cupboard = cupboard_with_drawer("cupboard", (0.0, 0.0), 90.0, lock=LockCfg("key"))
    floor_m = cupboard[1].position_m[2] - 0.08 + 0.01
    coin = key("coin", (0.0, 0.0), height_m=floor_m, length_m=0.1)
    world = empty_world(*cupboard, coin, key("key", (2.0, 0.0)))
    drawer, inside = world.prop("cupboard.drawer"), world.prop("coin")
    assert_at_rest(world)
    assert drawer.contains(inside)
    assert world.prop("cupboard").contains(inside)
    assert not drawer.open()
    assert drawer.unlock(world.prop("key"))
    assert drawer.open()
    let_pass(world, 1.6)
    assert drawer.opening == pytest.approx(1.0, abs=1e-6)
    assert drawer.position[1] == pytest.approx(0.75 * (0.4 - 0.026), abs=1e-5)
    assert drawer.contains(inside)
    assert inside.position[1] > 0.15


def test_the_lid_of_a_chest_opens_upwards():
    world = empty_world(*chest("chest", (0.0, 0.0)))
    lid = world.prop("chest.lid")
    assert_at_rest(world, 0.4)
    lid.open()
    let_pass(world, 1.6)
    assert lid.opening == 1.0
    assert lid.position[2] > 0.4
    lid.close()
    let_pass(world, 1.6)
    assert lid.opening == 0.0


def test_a_toy_that_falls_into_a_basket_stays_in_it():
    world = empty_world(basket("basket", (0.0, 0.0)), toy("toy", ToyKind.pyramid, (0.0, 0.0)))
    world.prop("toy").place((0.05, 0.05, 0.25), 0.4)
    let_pass(world, 1.5)
    assert world.prop("basket").contains(world.prop("toy"))
    assert world.prop("toy").position[2] < 0.1


@pytest.mark.parametrize("fraction", [1 / 8, 1 / 3, 1 / 2, 2 / 3, 1.0])
def test_a_fraction_piece_has_its_share_of_the_disc(fraction):
    """The arc is made of edges: up to 0.8 % of the area is missing."""
    world = empty_world(fraction_piece("piece", fraction, (0.0, 0.0)))
    rows = world.scene.find("piece").geoms
    table = world.scene.geoms
    area = 0.0
    for g in range(rows.start, rows.stop):
        first, count = int(table.sizes[g, 0]), int(table.sizes[g, 1])
        faces = table.faces[first : first + count]
        up = faces[faces[:, 2] > 0.99][:, 4:13].reshape(-1, 3, 3)
        area += np.linalg.norm(np.cross(up[:, 1] - up[:, 0], up[:, 2] - up[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(fraction * math.pi * 0.2**2, rel=0.009)
    assert_at_rest(world, 0.4)


def test_a_fraction_must_be_one():
    with pytest.raises(ValueError, match=r"fraction=1\.2"):
        fraction_piece("piece", 1.2, (0.0, 0.0))


@pytest.mark.parametrize(
    ("make", "numbers", "parts"),
    [
        (
            basket,
            {"size_m": (0.03, 0.4, 0.15)},
            ("size_m=(0.03, 0.4, 0.15)", "(0.03, 0.03, 0.015)"),
        ),
        (basket, {"size_m": (0.4, 0.02, 0.15)}, ("size_m=(0.4, 0.02, 0.15)",)),
        (basket, {"size_m": (0.4, 0.4, 0.01)}, ("size_m=(0.4, 0.4, 0.01)",)),
        (basket, {"size_m": (0.4, 0.4)}, ("size_m=(0.4, 0.4)",)),
        (chest, {"size_m": (0.35, 0.55, 0.045)}, ("(0.03, 0.03, 0.045)", "lid")),
        (
            cupboard_with_drawer,
            {"size_m": (0.05, 0.45, 0.5)},
            ("size_m=(0.05, 0.45, 0.5)", "(0.056, 0.072, 0.232)"),
        ),
        (
            cupboard_with_drawer,
            {"size_m": (0.4, 0.07, 0.5)},
            ("size_m=(0.4, 0.07, 0.5)", "0.072", "drawer_height_m=0.16"),
        ),
        (cupboard_with_drawer, {"size_m": (0.4, 0.45, 0.2)}, ("size_m=(0.4, 0.45, 0.2)",)),
        (cupboard_with_drawer, {"drawer_height_m": 0.45}, ("drawer_height_m=0.45",)),
        (cupboard_with_drawer, {"drawer_height_m": 0.01}, ("drawer_height_m=0.01", "0.0133")),
    ],
)
def test_sizes_without_an_interior_are_refused_by_the_name_of_the_argument(make, numbers, parts):
    with pytest.raises(ValueError, match=naming("thing", *parts)):
        make("thing", (0.0, 0.0), **numbers)


@pytest.mark.parametrize(
    ("make", "size_m"),
    [
        (lambda *place, **size: [basket(*place, **size)], (0.031, 0.031, 0.016)),
        (chest, (0.031, 0.031, 0.046)),
        (cupboard_with_drawer, (0.057, 0.073, 0.233)),
    ],
)
def test_the_smallest_sizes_can_be_built(make, size_m):
    cfgs = make("thing", (0.0, 0.0), size_m=size_m)
    world = empty_world(*cfgs)
    assert list(world.props) == [cfg.name for cfg in cfgs]
    world.close()
