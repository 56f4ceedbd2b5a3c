"""Containers and doors as the verbs of walkers change them."""

from dataclasses import replace

import numpy as np
import pytest
from verbs import begin, do, seeing, toy
from walking import ball, box, empty_world, let_pass, wall

from veca_marl.sim.physics import PropCfg, PropShape
from veca_marl.sim.physics.interactions import PutInto
from veca_marl.sim.physics.props.containers import basket, chest
from veca_marl.sim.physics.props.doors import door_leaf, sliding_leaf
from veca_marl.sim.physics.props.joint import LockCfg

BASKET = ("basket", (0.3, 0.3, 0.02), 0.0, (0.6, 0.0, 0.01))  # a plate: what is put on it stays


def plate(**more):
    name, edges_m, mass_kg, position = BASKET
    return box(name, edges_m, mass_kg, position, interactions=["put_into"], **more)


def test_what_is_put_into_a_container_lies_in_it():
    world = empty_world(toy(position=(0.5, 0.5, 0.05)), plate())
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    prop, basket = world.prop("toy"), world.prop("basket")
    assert not do(world, walker, "put_into")  # the hand is empty
    walker.grab(prop)
    basket.accepts = lambda one: False
    assert not do(world, walker, "put_into")
    assert walker.held is prop
    basket.accepts = lambda one: one is prop
    assert do(world, walker, "put_into")
    assert walker.applied_verb == ("put_into", basket)
    assert walker.held is None
    let_pass(world, 0.4)
    assert prop.position[2] == pytest.approx(0.07, abs=0.01)
    low, high = basket.bounds()
    assert ((low < prop.position)[:2] & (prop.position < high)[:2]).all()


@pytest.mark.parametrize("yaw_deg", [0.0, 45.0])
def test_several_props_lie_side_by_side_in_a_container(yaw_deg):
    cubes = [
        box(f"cube{i}", (0.1, 0.1, 0.1), 0.2, (0.5, 0.8 + 0.3 * i, 0.05), interactions=["grab"])
        for i in range(3)
    ]
    world = empty_world(*cubes, plate(yaw_deg=yaw_deg))
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    for i in range(3):
        walker.grab(world.prop(f"cube{i}"))
        assert do(world, walker, "put_into")  # also with a cube nearer to the centre of the view
        let_pass(world, 0.4)
    heights = [world.prop(f"cube{i}").position[2] for i in range(3)]
    assert heights == pytest.approx([0.07] * 3, abs=0.01)
    assert len({tuple(np.round(world.prop(f"cube{i}").position[:2], 2)) for i in range(3)}) == 3


def test_a_prop_that_is_too_wide_for_a_container_is_refused():
    world = empty_world(ball("toy", 0.2, position=(0.5, 0.7, 0.2)), plate())
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    walker.grab(world.prop("toy"))
    assert not do(world, walker, "put_into")


def door(lock=None):
    leaf = door_leaf("door", (1.0, 0.0), 0.0, 0.7, 1.0, opens_to_front=True, lock=lock)
    return replace(leaf, interactions=["open", "close"])


def test_a_door_is_opened_and_closed():
    world = empty_world(door())
    walker = seeing(world, extra_verbs=["open", "close"])
    begin(world)
    assert not do(world, walker, "close")  # it is closed
    assert not do(world, walker, "grab")
    assert do(world, walker, "open")
    let_pass(world, 3.0)
    assert world.prop("door").opening > 0.9
    walker.look_toward_point(world.prop("door").position)
    world.refresh()
    assert do(world, walker, "close")
    let_pass(world, 3.0)
    assert world.prop("door").opening < 0.1


def test_a_sliding_door_is_opened_passed_and_closed():
    beside = wall("beside", length_m=1.0, position=(1.0, 1.0, 0.0), yaw_deg=90.0)
    leaf = sliding_leaf("door", (1.0, 0.0), 0.0, 1.0, 1.5, wall="beside")
    world = empty_world(beside, leaf)
    walker, leaf = seeing(world), world.prop("door")
    begin(world)
    walker.walk(1.0, 0.0)
    let_pass(world, 2.0)
    assert walker.position[0] < 1.0  # it does not yield across its axis
    walker.walk(0.0, 0.0)
    walker.place((0.3, -0.1, 0.0))
    world.refresh()
    assert walker.open(leaf)
    let_pass(world, 3.0)
    assert leaf.opening > 0.9
    walker.look_toward_point((1.0, 0.42, 0.45))
    world.refresh()
    assert walker.is_interactable(leaf)  # its handle stays in the opening
    walker.walk(1.0, 0.0)
    let_pass(world, 2.0)
    assert walker.position[0] > 1.3
    assert walker.close(leaf)
    let_pass(world, 3.0)
    assert leaf.opening < 0.01


def test_methods_open_and_close_as_the_verbs_do():
    world = empty_world(door(), toy())
    walker = seeing(world)
    begin(world)
    leaf = world.prop("door")
    assert not walker.close(leaf)  # it is closed
    assert not walker.open(world.prop("toy"))
    assert walker.open(leaf)
    let_pass(world, 3.0)
    assert leaf.opening > 0.9
    assert walker.close(leaf)


def test_a_locked_door_opens_with_its_key_in_the_hand_only():
    lock = LockCfg(key="key")
    world = empty_world(door(lock), toy("key", (0.5, 0.7, 0.05)), toy("other", (0.5, -0.7, 0.05)))
    walker = seeing(world, extra_verbs=["open"])
    begin(world)
    leaf = world.prop("door")
    assert not do(world, walker, "open")
    walker.grab(world.prop("other"))
    assert not do(world, walker, "open")
    assert leaf.locked
    walker.release()
    walker.grab(world.prop("key"))
    assert do(world, walker, "open")
    let_pass(world, 2.0)
    assert (leaf.locked, leaf.opening > 0.5) == (False, True)
    world.reset(np.random.default_rng(0))
    assert (leaf.locked, leaf.opening) == (True, pytest.approx(0.0, abs=1e-3))


@pytest.mark.parametrize(("radius_m", "fits"), [(0.15, True), (0.18, True), (0.19, False)])
def test_what_is_put_into_a_basket_is_then_in_it(radius_m, fits):
    """The walls of a basket leave 0.37 m of its 0.4 m."""
    can = PropCfg(
        name="can",
        shape=PropShape.cylinder,
        size_m=[radius_m, 0.08],
        position_m=(0.4, 0.0, 0.04),
        mass_kg=0.5,
    )
    world = empty_world(basket("basket", (1.0, 0.0)), can)
    walker = seeing(world, extra_verbs=["put_into"])
    begin(world)
    assert walker.grab(world.prop("can"))
    assert PutInto().attempt(walker, world.prop("basket")) is fits
    let_pass(world, 2.0)
    assert world.prop("basket").contains(world.prop("can")) is fits


def test_nothing_is_put_into_a_closed_chest():
    world = empty_world(*chest("chest", (1.0, 0.0)), toy())
    walker = seeing(world, extra_verbs=["put_into", "open"])
    begin(world)
    assert walker.grab(world.prop("toy"))
    assert not PutInto().attempt(walker, world.prop("chest"))
    assert walker.open(world.prop("chest.lid"))
    let_pass(world, 2.0)
    assert PutInto().attempt(walker, world.prop("chest"))
    let_pass(world, 2.0)
    assert world.prop("chest").contains(world.prop("toy"))
