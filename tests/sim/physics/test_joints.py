"""Doors, drawers and lids: friction, range, locks, motors, sound, pushes, and the reset."""

import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import naming
from walking import box, empty_world, film, let_pass, walker_in

from veca_marl.sim.physics import (
    JointCfg,
    JointKind,
    LockCfg,
    PartCfg,
    PlaygroundCfg,
    PropCfg,
    PropShape,
    World,
)
from veca_marl.sim.physics.bullet_client import pybullet

HEIGHT_M, WIDTH_M, THICKNESS_M, MASS_KG = 2.0, 0.9, 0.04, 3.0
INERTIA = MASS_KG * (WIDTH_M**2 + THICKNESS_M**2) / 12.0 + MASS_KG * (WIDTH_M / 2.0) ** 2
"""Moment of inertia (kg m^2) of the door about its hinge."""


def door(**joint):
    """A door that opens to -x, hinged at its end at y = -0.45."""
    numbers = {"anchor_m": (0.0, -WIDTH_M / 2.0, 0.0), "range_deg": 100.0} | joint
    return PropCfg(
        "door",
        PropShape.box,
        [THICKNESS_M, WIDTH_M, HEIGHT_M],
        (1.0, 0.0, 1.05),
        mass_kg=MASS_KG,
        joint=JointCfg(**numbers),
    )


CUPBOARD = PropCfg("cupboard", PropShape.box, [0.5, 0.4, 0.5], (-1.0, 0.0, 0.25))


def drawer(**joint):
    """A drawer of four boards and a floor in a cupboard, which slides out to x."""
    boards = [
        PartCfg(PropShape.box, [0.3, 0.3, 0.01], (0.0, 0.0, -0.05)),
        *(PartCfg(PropShape.box, [0.3, 0.01, 0.1], (0.0, y, 0.0)) for y in (-0.15, 0.15)),
        *(PartCfg(PropShape.box, [0.01, 0.3, 0.1], (x, 0.0, 0.0)) for x in (-0.15, 0.15)),
    ]
    numbers = {"parent": "cupboard", "axis": (1.0, 0.0, 0.0), "range_m": 0.25, "friction": 1.0}
    return PropCfg(
        "drawer",
        PropShape.compound,
        [],
        (-1.0, 0.0, 0.35),
        mass_kg=1.0,
        parts=boards,
        joint=JointCfg(JointKind.slide, **(numbers | joint)),
    )


def swinging(world, speed):
    """Give the door a speed (rad/s) by an angular impulse in its first physics step."""
    prop = world.prop("door")
    torque = INERTIA * speed / world.clock.substep_s
    world.client.applyExternalTorque(
        prop.body_id, prop.link, (0.0, 0.0, torque), pybullet.WORLD_FRAME
    )
    return prop


def test_without_friction_a_door_keeps_its_speed():
    world = empty_world(door(friction=0.0))
    prop = swinging(world, 0.5)
    let_pass(world, 0.04)
    start = prop.joint.speed
    let_pass(world, 2.0)
    assert start == pytest.approx(0.5, rel=1e-6)
    assert prop.joint.speed == pytest.approx(start, rel=1e-9)
    assert prop.opening == pytest.approx(0.5 * 2.04 / math.radians(100.0), rel=0.01)


def test_friction_stops_a_door_as_coulomb_says():
    """The torque is constant: speed falls by T / I per second, and the door stays where it is."""
    torque = 0.4
    world = empty_world(door(friction=torque))
    prop = swinging(world, 1.0)
    let_pass(world, 0.04)
    first = prop.joint.speed
    let_pass(world, 0.4)
    assert first - prop.joint.speed == pytest.approx(0.4 * torque / INERTIA, rel=1e-3)
    let_pass(world, 3.0)
    assert prop.joint.speed == pytest.approx(0.0, abs=1e-9)
    angle = prop.opening * math.radians(100.0)
    assert angle == pytest.approx(0.5 * INERTIA / torque, rel=0.03)


def test_the_frame_turns_about_the_hinge():
    world = empty_world(door())
    prop = world.prop("door")
    prop.set_opening(0.9)
    assert prop.opening == pytest.approx(0.9)
    np.testing.assert_allclose(prop.rotation[:, 1], (-1.0, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(prop.position, (1.0 - 0.45, -0.45, 1.05), atol=1e-6)
    world.refresh()
    geom = world.scene.find("door").geoms.start
    np.testing.assert_allclose(world.scene.geoms.positions[geom], prop.position, atol=1e-12)
    low, high = prop.bounds()
    np.testing.assert_allclose((low + high) / 2.0, prop.position, atol=1e-3)


@pytest.mark.parametrize("speed", [-30.0, 30.0])
def test_the_range_is_never_exceeded(speed):
    world = empty_world(door(friction=0.0, opening=0.5))
    prop, angles = world.prop("door"), []
    world.after_substep.append(lambda: angles.append(prop.joint._state()[0]))
    swinging(world, speed)
    let_pass(world, 1.0)
    assert min(angles) >= 0.0
    assert max(angles) <= math.radians(100.0)
    assert (min(angles) == 0.0) if speed < 0.0 else (max(angles) == math.radians(100.0))


def test_a_drawer_is_driven_open_and_closed_within_its_cupboard():
    world = empty_world(CUPBOARD, drawer(open_s=0.8))
    prop = world.prop("drawer")
    assert world.prop("cupboard").contains(prop)
    assert prop.open()
    let_pass(world, 1.0)
    assert prop.opening == 1.0
    np.testing.assert_allclose(prop.position, (-0.75, 0.0, 0.35), atol=1e-9)
    let_pass(world, 0.4)
    assert prop.opening == 1.0
    assert prop.close()
    let_pass(world, 1.0)
    assert prop.opening == 0.0


def test_what_lies_in_a_drawer_comes_with_it():
    world = empty_world(
        CUPBOARD, drawer(open_s=1.5), box("key", (0.05, 0.05, 0.02), 0.05, (-1.0, 0.0, 0.32))
    )
    prop, key = world.prop("drawer"), world.prop("key")
    # the cupboard of this test is solid: the key must not be pushed out of it
    world.prop("cupboard").place((-1.0, 0.0, 0.04))
    let_pass(world, 0.2)
    assert prop.contains(key)
    prop.open()
    let_pass(world, 2.0)
    assert prop.opening == 1.0
    assert prop.contains(key)
    assert key.position[0] > -0.95


@pytest.mark.parametrize("friction", [0.0, 5.0, 20.0])
@pytest.mark.parametrize("motor", [0.0, 1.0, 4.0])
def test_a_motor_has_its_force_beside_the_friction(friction, motor):
    """A slide of 10 kg without an obstacle moves as by the force of the motor alone."""
    slide = JointCfg(
        JointKind.slide, axis=(1.0, 0.0, 0.0), range_m=1.0, friction=friction, motor=motor
    )
    world = empty_world(box("slab", mass_kg=10.0, position=(0.0, 0.0, 0.5), joint=slide))
    slab = world.prop("slab")
    slab.open()
    steps = 10
    for _ in range(steps):
        world.step()
    assert slab.joint.speed == pytest.approx(motor / 10.0 * steps * 0.04, rel=0.03, abs=1e-6)


def test_a_motor_gives_up_at_an_obstacle():
    world = empty_world(CUPBOARD, drawer(motor=3.0), box("weight", mass_kg=50.0))
    prop = world.prop("drawer")
    world.prop("weight").place((-0.6, 0.0, 0.15))
    world.prop("cupboard").place((-1.0, 0.0, -5.0))
    prop.open()
    let_pass(world, 2.0)
    assert prop.opening < 0.5
    assert prop.joint.driven


def test_a_locked_door_does_not_move_until_its_key_unlocks_it():
    key = box("key", (0.05, 0.05, 0.05), 0.1, (0.0, 2.0, 0.025))
    other = box("coin", (0.05, 0.05, 0.05), 0.1, (0.0, 3.0, 0.025))
    world = empty_world(door(lock=LockCfg("key"), opening=0.0), key, other)
    prop = world.prop("door")
    before = prop.position, prop.rotation
    assert prop.locked
    assert not prop.open()
    swinging(world, 5.0)
    let_pass(world, 0.4)
    np.testing.assert_array_equal(prop.position, before[0])
    np.testing.assert_array_equal(prop.rotation, before[1])
    assert not prop.unlock(world.prop("coin"))
    assert prop.unlock(world.prop("key"))
    assert prop.open()
    let_pass(world, 1.2)
    assert prop.opening == 1.0


def test_a_reset_restores_opening_motor_and_lock_bit_by_bit():
    world = empty_world(
        CUPBOARD, drawer(), door(opening=0.3, lock=LockCfg("ball")), box("ball", position=(0, 1, 1))
    )
    world.freeze()

    def episode():
        world.reset(np.random.default_rng(0))
        start = world.scene.positions.copy()
        world.prop("door").unlock(world.prop("ball"))
        world.prop("door").open()
        world.prop("drawer").open()
        return start, film(world, 15)

    (first, path), (again, same) = episode(), episode()
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(path, same)
    world.reset(np.random.default_rng(1))
    assert world.prop("door").locked
    assert not world.prop("drawer").joint.driven
    rested = film(world, 5)
    row = world.scene.find("drawer").rows.start
    np.testing.assert_array_equal(rested[:, row], rested[:1, row].repeat(5, axis=0))


def test_a_reset_restores_what_was_opened_and_unlocked_before_the_world_was_frozen():
    ajar = replace(door(lock=LockCfg("ball")), name="ajar", position_m=(3.0, 0.0, 1.05))
    world = empty_world(door(lock=LockCfg("ball")), ajar, box("ball", position=(0, 1, 1)))
    world.prop("door").unlock(world.prop("ball"))
    world.prop("ajar").set_opening(0.5)
    world.freeze()
    world.prop("door").joint.lock()
    world.reset(np.random.default_rng(0))
    assert not world.prop("door").locked
    assert world.prop("ajar").locked
    world.step()
    assert world.prop("ajar").opening == pytest.approx(0.5)


def test_a_walker_pushes_a_door_open_and_stops_at_a_locked_one():
    for lock in (None, LockCfg()):
        # hinged at +y: it opens away from the walker
        world = empty_world(door(anchor_m=(0, WIDTH_M / 2, 0), friction=0.3, lock=lock))
        walker = walker_in(world)
        for _ in range(60):
            walker.act({"move": np.array([1.0, 0.0], np.float32)})
            world.step()
        prop = world.prop("door")
        if lock is None:
            assert prop.opening > 0.4
            assert walker.position[0] > 1.1
        else:
            assert prop.opening == 0.0
            assert walker.position[0] == pytest.approx(
                1.0 - THICKNESS_M / 2.0 - walker.radius_m, abs=0.002
            )


def test_a_walker_stops_at_a_door_that_is_pushed_against_its_stop():
    world = empty_world(door(friction=0.3))  # it opens towards the walker
    walker = walker_in(world)
    for _ in range(60):
        walker.act({"move": np.array([1.0, 0.0], np.float32)})
        world.step()
    assert world.prop("door").opening == 0.0
    assert walker.position[0] < 1.0 - THICKNESS_M / 2.0 - walker.radius_m + 0.002


def test_a_walker_can_neither_grab_nor_kick_a_drawer():
    world = empty_world(CUPBOARD, drawer(), box("cube"))
    walker = walker_in(world)
    assert walker.can_grab(world.prop("cube"))
    assert not walker.can_grab(world.prop("drawer"))
    world.prop("drawer").place((0.3, 0.0, 0.06))
    assert not walker.can_kick(world.prop("drawer"))


def panels(order):
    """A tall panel and a small block above it on one slide to x; `order` 1 swaps the parts."""
    parts = [
        PartCfg(PropShape.box, [0.1, 0.4, 0.4], (0.0, 0.0, 0.0)),
        PartCfg(PropShape.box, [0.1, 0.1, 0.1], (0.0, 0.0, 0.8)),
    ]
    slide = JointCfg(JointKind.slide, axis=(1.0, 0.0, 0.0), range_m=0.6, friction=0.5, motor=20.0)
    return PropCfg(
        "panels",
        PropShape.compound,
        [],
        (0.5, 0.0, 0.25),
        mass_kg=2.0,
        parts=parts[:: 1 - 2 * order],
        joint=slide,
    )


@pytest.mark.parametrize("order", [0, 1])
def test_every_part_of_a_driven_compound_stops_at_a_fixed_prop(order):
    ahead = box("ahead", edges_m=(0.1, 0.4, 0.4), mass_kg=0.0, position=(0.9, 0.0, 0.25))
    world = empty_world(panels(order), ahead)
    world.prop("panels").open()
    let_pass(world, 2.4)
    assert world.prop("panels").opening * 0.6 == pytest.approx(0.3, abs=0.002)


@pytest.mark.parametrize("order", [0, 1])
def test_a_walker_pushes_every_part_of_a_compound(order):
    world = empty_world(panels(order))
    walker = walker_in(world)
    for _ in range(50):
        walker.act({"move": np.array([0.5, 0.0], np.float32)})
        world.step()
    panel = world.prop("panels").position[0] - 0.05
    assert world.prop("panels").opening > 0.3
    assert walker.position[0] + walker.radius_m <= panel + 0.01


def test_no_part_of_an_attached_compound_collides_with_its_parent():
    case = box("case", edges_m=(0.4, 0.4, 0.4), mass_kg=0.0, position=(0.5, 0.0, 0.25))
    world = empty_world(case, replace(panels(1), joint=replace(panels(1).joint, parent="case")))
    panel = world.prop("panels")
    assert world.overlap_m(panel.body_id, world.prop("case").body_id) == 0.0
    panel.open()
    let_pass(world, 2.4)
    assert panel.opening == 1.0


def test_yields_tells_apart_pushes_that_move_and_pushes_against_the_stop():
    world = empty_world(door(), box())
    prop = world.prop("door")
    edge = prop.position + np.array([0.0, 0.4, 0.0])
    assert prop.yields(edge, (-1.0, 0.0, 0.0))
    assert not prop.yields(edge, (1.0, 0.0, 0.0))
    prop.set_opening(0.5)
    assert prop.yields(edge, (1.0, 0.0, 0.0))
    assert world.prop("box").yields((0, 0, 0), (1, 0, 0))


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"kind": "ball"}, ("kind='ball'", "hinge")),
        ({"axis": (0, 0, 0)}, ("axis=(0, 0, 0)",)),
        ({"range_deg": 0.0}, ("range_deg=0.0",)),
        ({"range_deg": 270.0}, ("range_deg=270.0", "180")),
        ({"range_m": math.nan}, ("range_m=nan",)),
        ({"friction": -1.0}, ("friction=-1.0",)),
        ({"opening": 1.5}, ("opening=1.5",)),
    ],
)
def test_impossible_joints_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        JointCfg(**numbers)


def test_a_joint_needs_a_movable_prop_and_a_fixed_parent():
    with pytest.raises(ValueError, match=r"'door': mass_kg=0\.0"):
        PropCfg("door", PropShape.box, [1.0, 1.0, 1.0], joint=JointCfg())
    world = empty_world(box("crate"))
    with pytest.raises(ValueError, match=naming("'drawer'", "joint.parent='cupboard'", "[]")):
        world.add_prop(drawer())
    with pytest.raises(ValueError, match=naming("'crate'", "joint")):
        world.prop("crate").set_opening(0.5)


@pytest.mark.parametrize(("key", "fault"), [("kye", ""), ("cupboard", "fixed")])
def test_a_lock_without_a_key_that_can_be_carried_is_refused_with_the_loose_props(key, fault):
    world = World(PlaygroundCfg(props=[CUPBOARD, door(lock=LockCfg(key, locked=False))]))
    for name in ("ball", "key"):
        world.add_prop(box(name, position=(0.0, 1.0, 1.0)))
    with pytest.raises(
        ValueError, match=naming("'door'", f"'{key}'", "lock", fault, "['ball', 'key']")
    ):
        world.freeze()
    world.close()
