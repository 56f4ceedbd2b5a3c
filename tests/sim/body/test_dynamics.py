"""Momentum and energy of a joint-level body against Bullet's."""

import numpy as np
import pytest
from humanoids import kinetic_energy, random_torques, several_humanoids

from tools.fidelity.mechanics.momentum import totals
from veca_marl.sim.body.humanoid import Detail


@pytest.fixture(params=Detail)
def alone(request):
    world, (body,) = several_humanoids(1, request.param)
    yield world, body
    world.close()


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
