"""Doors and drawers near a walker, and where they are shown: nothing is left out that matters."""

import math

import numpy as np
import pytest
from walking import empty_world, film, let_pass, walker_in

from veca_marl.sim.body.walker import obstacles
from veca_marl.sim.physics import JointCfg, JointKind, LockCfg, PropCfg, PropShape
from veca_marl.sim.physics.bullet_client import pybullet
from veca_marl.sim.physics.props.geoms import swept_radius_m

JOINTS = {
    "door": JointCfg(axis=(0.0, 0.0, -1.0), anchor_m=(0.02, -0.45, 0.0), range_deg=100.0),
    "lid": JointCfg(axis=(0.0, -1.0, 0.0), anchor_m=(-0.2, 0.0, 0.0), range_deg=120.0),
    "drawer": JointCfg(JointKind.slide, axis=(1.0, 0.2, 0.0), range_m=0.4),
}
RADIUS_M = 0.11


def leaf(kind="door", position=(1.0, 0.0, 0.55), **joint):
    numbers = vars(JOINTS[kind]) | joint
    size = [0.04, 0.9, 1.0] if kind == "door" else [0.4, 0.3, 0.1]
    return PropCfg(
        kind, PropShape.box, size, position, mass_kg=1.0, joint=JointCfg(**numbers), yaw_deg=20.0
    )


@pytest.mark.parametrize("kind", JOINTS)
def test_a_leaf_stays_within_its_radius_at_all_openings(kind):
    world = empty_world(leaf(kind))
    prop = world.prop(kind)
    anchor = prop.position + prop.rotation @ np.array(prop.cfg.joint.anchor_m)
    farthest = 0.0
    for opening in np.linspace(0.0, 1.0, 21):
        prop.set_opening(opening)
        corners = prop.position + prop.geoms[0].corners() @ prop.rotation.T
        farthest = max(farthest, np.hypot(*(corners - anchor)[:, :2].T).max())
    radius = swept_radius_m(prop.geoms, prop.cfg.joint)
    assert farthest <= radius + 1e-6
    if kind == "door":
        assert radius == pytest.approx(farthest, abs=1e-6)


@pytest.mark.parametrize("kind", ["door", "drawer"])
def test_leaving_out_distant_leaves_does_not_change_a_bit(kind, monkeypatch):
    """A walker passes in a curve, and pushes the leaf on its way."""

    def positions():
        world = empty_world(leaf(kind), leaf("lid", (-3.0, 0.0, 0.05)))
        walker = walker_in(world, place=(-0.6, -0.2, 0.0))
        walker.walk(1.0, 0.15)
        return film(world, 100), world.prop(kind).opening

    culled, opening = positions()
    monkeypatch.setattr(obstacles, "swept_radius_m", lambda geoms, joint: 1e9)
    assert positions()[0].tobytes() == culled.tobytes()
    assert opening > 0.1


def test_a_leaf_that_is_placed_elsewhere_stops_a_walker_there_and_no_longer_here():
    world = empty_world(leaf(lock=LockCfg(key="")))
    walker, door = walker_in(world), world.prop("door")
    walker.walk(1.0, 0.0)
    let_pass(world, 0.2)
    door.place((6.0, 0.0, 0.55))
    let_pass(world, 8.0)
    assert walker.position[0] == pytest.approx(5.98 - RADIUS_M, abs=0.004)


def test_only_leaves_within_reach_are_near():
    world = empty_world(leaf(), leaf("lid", (-3.0, 0.0, 0.05)))
    found = obstacles.Leaves(list(world.props.values()))
    hinge = np.array([1.0, 0.0]) + 0.45 * np.array([math.sin(0.349), -math.cos(0.349)])
    assert [prop.name for prop in found.near(hinge, 0.0)] == ["door"]
    assert found.near(hinge + np.array([1.2, 0.0]), 0.2) == []
    assert [prop.name for prop in found.near(hinge + np.array([1.2, 0.0]), 0.4)] == ["door"]


def test_a_leaf_that_was_placed_elsewhere_is_near_its_built_place_after_a_reset():
    world = empty_world(leaf())
    found = obstacles.Leaves(list(world.props.values()))
    world.freeze()
    here, there = np.array([1.0, 0.0]), np.array([6.0, 0.0])
    world.prop("door").place((6.0, 0.0, 0.55))
    assert (found.near(here, 0.5), found.near(there, 0.5)) == ([], [world.prop("door")])
    world.reset(np.random.default_rng(0))
    assert (found.near(here, 0.5), found.near(there, 0.5)) == ([world.prop("door")], [])


@pytest.mark.parametrize("moves", ["pushed", "driven", "put", "placed", "locked"])
def test_the_scene_shows_a_leaf_where_bullet_has_it(moves):
    """Poses of leaves that stand still are not read again: whatever moves one is noticed."""
    world = empty_world(leaf(friction=0.0))
    world.freeze()
    world.reset(np.random.default_rng(0))
    let_pass(world, 0.2)
    door = world.prop("door")
    start = door.mass_centre
    if moves == "pushed":
        world.client.setJointMotorControl2(door.body_id, 1, pybullet.TORQUE_CONTROL, force=5.0)
    elif moves == "driven":
        assert door.open()
    elif moves == "put":
        door.set_opening(0.5)
    elif moves == "placed":
        door.place((3.0, 1.0, 1.05))
    elif moves == "locked":
        door.joint.lock()
        door.set_opening(0.3)
    for _ in range(10):
        world.step()
        state = world.client.getLinkState(door.body_id, 1, computeForwardKinematics=1)
        np.testing.assert_allclose(door.mass_centre, state.centre, atol=1e-9)
    assert np.linalg.norm(door.mass_centre - start) > 1e-3
