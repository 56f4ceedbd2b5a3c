"""Mass matrix, momentum and energy of a joint-level body against Bullet's."""

import numpy as np
import pytest
from humanoids import kinetic_energy, random_torques, several_humanoids

from veca_marl.fidelity.momentum import totals
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.body.humanoid import Detail
from veca_marl.sim.physics import pybullet

JOINTS = load_skeleton().joints


@pytest.fixture(params=Detail)
def alone(request):
    world, (body,) = several_humanoids(1, request.param)
    yield world, body
    world.close()


def test_the_mass_matrix_equals_that_of_bullet(alone):
    world, body = alone
    low, high = ([getattr(joint, end) for joint in JOINTS] for end in ("low_rad", "high_rad"))
    body.place((0.3, 0.0, 1.0), 1.0, np.random.default_rng(0).uniform(low, high))
    ours = body.articulation.dynamics.state.mass_matrix
    angles = body.joint_angles()[body.articulation.moving].tolist()
    theirs = np.array(
        pybullet.calculateMassMatrix(body.body_id, angles, physicsClientId=world.client)
    )
    # Bullet's rows of the base have other axes; those of the joints are the same
    scale = np.sqrt(np.outer(np.diag(theirs), np.diag(theirs)))[6:, 6:]
    assert np.abs((ours - theirs)[6:, 6:] / scale).max() < 1e-5
    np.testing.assert_allclose(
        np.linalg.eigvalsh(ours[:6, :6]), np.linalg.eigvalsh(theirs[:6, :6]), rtol=1e-5
    )


def test_momentum_and_energy_of_a_moving_body_are_the_sums_over_its_links(alone):
    world, body = alone
    for _ in random_torques(world, [body], 0.2):
        pass
    dynamics, found = body.articulation.dynamics, totals(world, body)
    spin, momentum = np.split(dynamics.state.momentum, 2)
    np.testing.assert_allclose(momentum, found.mass_kg * found.velocity, atol=1e-6)
    np.testing.assert_allclose(spin, found.angular_momentum, atol=1e-6)
    assert dynamics.kinetic_energy() == pytest.approx(found.energy_j, rel=1e-6)
    assert dynamics.kinetic_energy() == pytest.approx(kinetic_energy(world, body), rel=1e-6)
