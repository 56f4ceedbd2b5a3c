"""Two bodies in free flight, mirror images of each other, stay mirror images."""

import numpy as np
import pytest
from humanoids import remove_gravity
from walking import empty_world

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import Posture

MIRROR = np.array([1.0, -1.0, 1.0])  # in the plane of x and z
SPREAD = Posture(0.0, {"upper_arm.abduction": 60.0, "thigh.abduction": 20.0})
NAMES = [f"{joint.bone}.{joint.label}" for joint in load_skeleton().joints]
SIDES = {"l_": "r_", "r_": "l_"}


def mirrored_joints(values):
    """Exchange left and right; joints of the trunk out of the median plane change their sign."""
    source = [NAMES.index(SIDES.get(name[:2], name[:2]) + name[2:]) for name in NAMES]
    median = np.array([name[:2] not in SIDES for name in NAMES])
    turning = np.array([name.endswith((".lateral", ".rotation")) for name in NAMES])
    return np.where(median & turning, -1.0, 1.0) * values[source]


@pytest.fixture(params=Detail, scope="module")
def pair(request):
    world = empty_world()
    bodies = [Humanoid(name, HumanoidCfg(detail=request.param), world) for name in ("a", "b")]
    world.freeze()
    remove_gravity(world)
    yield world, bodies
    world.close()


def fly(world, bodies, inset_rad, torque, seed=0):
    """Drive mirrored bodies by mirrored random torques for one agent step.

    Joints start at least `inset_rad`, or half of their range, inside their limits.
    """
    world.reset(np.random.default_rng(seed))
    rng = np.random.default_rng(seed)
    joints = load_skeleton().joints
    low, high = (np.array([getattr(j, end) for j in joints]) for end in ("low_rad", "high_rad"))
    inset = np.minimum(inset_rad, 0.5 * (high - low))
    angles = bodies[0].posture_angles(SPREAD) + rng.uniform(-0.05, 0.05, len(low))
    angles, torques = np.clip(angles, low + inset, high - inset), rng.uniform(-torque, torque, 82)
    for body, joint_map, side in zip(bodies, (np.array, mirrored_joints), (1.0, -1.0), strict=True):
        body.place((0.0, 5.0 * side, 20.0), 0.3 * side, joint_map(angles))
        body.act({"joints": joint_map(torques)})
    world.refresh()
    world.step()


def differences(bodies):
    """Return the greatest differences of pose, velocity, joint angles and joint speeds."""
    one, other = (body.articulation.dynamics.state for body in bodies)
    spin, velocity = -MIRROR * other.velocity[:3], MIRROR * other.velocity[3:6]
    a, b = bodies
    found = [
        one.position - MIRROR * other.position,
        one.rotation - np.outer(MIRROR, MIRROR) * other.rotation,
        one.velocity[:6] - np.concatenate([spin, velocity]),
        a.joint_angles() - mirrored_joints(b.joint_angles()),
        a.joint_velocities() - mirrored_joints(b.joint_velocities()),
    ]
    return [float(np.abs(difference).max()) for difference in found]


def test_mirrored_bodies_stay_mirrored_away_from_joint_limits(pair):
    world, bodies = pair
    fly(world, bodies, inset_rad=0.2, torque=0.02)
    assert np.abs(bodies[0].joint_velocities()).max() > 0.1
    assert not any(body.self_contacts() for body in bodies)
    assert max(differences(bodies)) < 1e-9


def test_mirrored_bodies_stay_mirrored_at_joint_limits(pair):
    """Stops of joints are so stiff that they amplify rounding by a factor of a million."""
    world, bodies = pair
    fly(world, bodies, inset_rad=0.0, torque=1.0)
    assert not any(body.self_contacts() for body in bodies)
    position, rotation, velocity, angles, speeds = differences(bodies)
    assert max(position, rotation, angles) < 1e-8
    assert max(velocity, speeds) < 1e-5
