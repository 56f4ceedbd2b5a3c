"""A client of PyBullet: its functions are bound, its tuples are named."""

import numpy as np
import pytest

from veca_marl.sim.physics.bullet_client import (
    BulletClient,
    ContactPoint,
    DynamicsInfo,
    JointInfo,
    JointState,
    LinkState,
    RayHit,
    pybullet,
)

RADIUS_M = 0.1
MASS_KG = 2.0


def add_ball(client, position):
    shape = client.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS_M)
    return client.createMultiBody(MASS_KG, shape, basePosition=position)


def add_door(client):
    """A fixed base with a link on a hinge about z, 1 m along x, its centre of mass 0.5 m on."""
    shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5, 0.1, 0.1])
    return client.createMultiBody(
        0.0,
        -1,
        linkMasses=[MASS_KG],
        linkCollisionShapeIndices=[shape],
        linkVisualShapeIndices=[-1],
        linkPositions=[(1.0, 0.0, 0.0)],
        linkOrientations=[(0.0, 0.0, 0.0, 1.0)],
        linkInertialFramePositions=[(0.5, 0.0, 0.0)],
        linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)],
        linkParentIndices=[0],
        linkJointTypes=[pybullet.JOINT_REVOLUTE],
        linkJointAxis=[(0.0, 0.0, 1.0)],
    )


def test_tuples_have_as_many_entries_as_names(client):
    one, other = add_ball(client, (0.0, 0.0, 0.0)), add_ball(client, (0.19, 0.0, 0.0))
    door, number = add_door(client), client.id
    client.performCollisionDetection()
    entries = {
        ContactPoint: pybullet.getClosestPoints(one, other, 0.0, physicsClientId=number)[0],
        JointInfo: pybullet.getJointInfo(door, 0, physicsClientId=number),
        JointState: pybullet.getJointState(door, 0, physicsClientId=number),
        LinkState: pybullet.getLinkState(door, 0, 1, 1, physicsClientId=number),
        DynamicsInfo: pybullet.getDynamicsInfo(one, -1, physicsClientId=number),
        RayHit: pybullet.rayTest((-1, 0, 0), (1, 0, 0), physicsClientId=number)[0],
    }
    for kind, values in entries.items():
        assert len(values) == len(kind._fields), kind
    assert len(pybullet.getContactPoints(one, other, physicsClientId=number)[0]) == 14


def test_entries_of_points_are_where_their_names_say(client):
    one, other = add_ball(client, (0.0, 0.0, 0.0)), add_ball(client, (0.19, 0.0, 0.0))
    client.performCollisionDetection()
    for points in (client.getClosestPoints(one, other, 0.0), client.getContactPoints(one, other)):
        (point,) = points
        assert (point.body_a, point.body_b, point.link_a, point.link_b) == (one, other, -1, -1)
        np.testing.assert_allclose(point.position_on_a, (0.1, 0.0, 0.0), atol=1e-6)
        np.testing.assert_allclose(point.position_on_b, (0.09, 0.0, 0.0), atol=1e-6)
        np.testing.assert_allclose(point.normal_on_b, (-1.0, 0.0, 0.0), atol=1e-6)
        assert point.distance_m == pytest.approx(-0.01, abs=1e-6)
    assert len(client.getContactPoints()) == len(client.getContactPoints(bodyA=other)) == 1


def test_entries_of_a_ball_on_the_floor_are_its_weight_and_friction(client):
    plane = client.createCollisionShape(pybullet.GEOM_PLANE)
    floor = client.createMultiBody(0, plane)
    ball = add_ball(client, (0.0, 0.0, RADIUS_M))
    client.changeDynamics(ball, -1, lateralFriction=0.3, restitution=0.0)
    client.setGravity(0.0, 0.0, -10.0)
    for _ in range(240):
        client.stepSimulation()
    (point,) = client.getContactPoints(ball, floor)
    assert point.normal_force_n == pytest.approx(10.0 * MASS_KG, rel=0.02)
    info = client.getDynamicsInfo(ball, -1)
    assert (info.mass_kg, info.lateral_friction, info.restitution) == (MASS_KG, 0.3, 0.0)
    np.testing.assert_allclose(info.moments, 0.4 * MASS_KG * RADIUS_M**2, rtol=1e-6)


def test_entries_of_a_joint_and_its_link(client):
    door = add_door(client)
    info = client.getJointInfo(door, 0)
    assert (info.joint, info.kind, info.parent) == (0, pybullet.JOINT_REVOLUTE, -1)
    assert info.axis == (0.0, 0.0, 1.0)
    client.resetJointState(door, 0, np.pi / 2.0, 3.0)
    state = client.getJointState(door, 0)
    assert (state.position, state.velocity) == (pytest.approx(np.pi / 2.0), pytest.approx(3.0))
    link = client.getLinkState(door, 0, computeLinkVelocity=1, computeForwardKinematics=1)
    np.testing.assert_allclose(link.position, (1.0, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(link.centre, (1.0, 0.5, 0.0), atol=1e-6)
    np.testing.assert_allclose(link.velocity, (-1.5, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(link.angular_velocity, (0.0, 0.0, 3.0), atol=1e-6)
    assert client.getLinkStates(door, [0], 1, 1) == (link,)
    unasked = client.getLinkState(door, 0)
    assert np.isnan(unasked.velocity).all()
    assert np.isnan(unasked.angular_velocity).all()


def test_rays_say_what_they_hit(client):
    near, far = add_ball(client, (0.0, 0.0, 0.0)), add_ball(client, (1.0, 0.0, 0.0))
    (hit,) = client.rayTest((-1.0, 0.0, 0.0), (3.0, 0.0, 0.0))
    assert (hit.body_id, hit.link) == (near, -1)
    assert hit.fraction == pytest.approx(0.9 / 4.0)
    np.testing.assert_allclose(hit.position, (-RADIUS_M, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(hit.normal, (-1.0, 0.0, 0.0), atol=1e-6)
    rays = [(-1.0, 0.0, 0.0)], [(3.0, 0.0, 0.0)]
    assert client.rayTestBatch(*rays) == (hit,)
    both = [client.rayTestBatch(*rays, reportHitNumber=number)[0].body_id for number in (0, 1)]
    assert sorted(both) == [near, far]
    assert client.rayTestBatch(*rays, reportHitNumber=2)[0].body_id == -1


def test_clients_are_separate_and_pybullet_takes_them_for_their_numbers(client):
    other = BulletClient()
    add_ball(client, (0.0, 0.0, 0.0))
    assert (client.getNumBodies(), other.getNumBodies()) == (1, 0)
    assert pybullet.getNumBodies(physicsClientId=client) == 1
    other.close()


def test_a_closed_client_acts_on_no_other_one():
    closed = BulletClient()
    closed.close()
    closed.close()
    later = BulletClient()  # PyBullet gives it the number of the closed one
    for act in (closed.getNumBodies, closed.getContactPoints, closed.stepSimulation):
        with pytest.raises(pybullet.error):
            act()
    assert later.isConnected()
    later.close()


def test_functions_that_bullet_does_not_have_are_refused(client):
    with pytest.raises(AttributeError):
        client.getContactPoint  # noqa: B018
