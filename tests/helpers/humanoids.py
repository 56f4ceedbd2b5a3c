"""Several overlapping joint-level bodies, random torques, and their kinetic energy."""

import numpy as np
from walking import empty_world, wall

from veca_marl.sim.body.humanoid import Detail, Humanoid, HumanoidCfg
from veca_marl.sim.body.humanoid.postures import ON_BACK, ON_BELLY
from veca_marl.sim.physics.bullet_client import pybullet

# a room of 3 m x 3 m
WALLS = [
    wall("east", position=(1.55, 0.0, 0.0)),
    wall("west", position=(-1.55, 0.0, 0.0)),
    wall("north", position=(0.0, 1.55, 0.0), yaw_deg=0.0),
    wall("south", position=(0.0, -1.55, 0.0), yaw_deg=0.0),
]


def several_humanoids(bodies, detail=Detail.full, walls=False):
    """Return a frozen world and overlapping bodies in it."""
    world = empty_world(*(WALLS if walls else ()))
    humanoids = [Humanoid(f"child_{i}", HumanoidCfg(detail=detail), world) for i in range(bodies)]
    world.freeze()
    place_overlapping(world, humanoids)
    return world, humanoids


def place_overlapping(world, bodies):
    """Reset the world and place the bodies on top of each other."""
    world.reset(np.random.default_rng(0))
    for i, body in enumerate(bodies):
        body.place((0.1 * i, 0.1 * (i % 2), 0.2 * i), 0.5 * i, ON_BACK if i % 2 else ON_BELLY)
    world.refresh()


def random_torques(world, bodies, seconds, seed=0):
    """Apply full torques of random sign to all joints; yield after every agent step."""
    rng = np.random.default_rng(seed)
    for _ in range(round(seconds * 25)):
        for body in bodies:
            body.act({"joints": rng.choice([-1.0, 1.0], 82)})
        world.step()
        yield


def remove_gravity(world):
    """Set gravity to zero."""
    world.client.setGravity(0.0, 0.0, 0.0)


def set_random_joint_speeds(world, body, speed_radps, seed=0):
    """Set all joint speeds to random numbers."""
    rng = np.random.default_rng(seed)
    body.articulation.set_speeds(rng.uniform(-speed_radps, speed_radps, 82))
    assert body.articulation.read()
    world.refresh()


def kinetic_energy(world, body):
    """Return the kinetic energy of all links of a body, J."""
    body_id, client = body.body_id, world.client
    links = range(client.getNumJoints(body_id))
    states = client.getLinkStates(body_id, links, 1, 1)
    velocity, spin = client.getBaseVelocity(body_id)
    _, turn = client.getBasePositionAndOrientation(body_id)
    energy = _energy(world, body_id, -1, turn, velocity, spin)
    for link, state in zip(links, states, strict=True):
        energy += _energy(
            world, body_id, link, state.centre_orientation, state.velocity, state.angular_velocity
        )
    return energy


def _energy(world, body_id, link, turn, velocity, spin):
    info = world.client.getDynamicsInfo(body_id, link)
    rotation = np.reshape(pybullet.getMatrixFromQuaternion(turn), (3, 3))
    local_spin = rotation.T @ spin
    return 0.5 * (info.mass_kg * np.dot(velocity, velocity) + np.dot(info.moments, local_spin**2))
