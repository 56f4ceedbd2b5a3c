"""Collisions of props: momentum, restitution, and rest after a fall."""

import pytest

from tools.fidelity.mechanics.collisions import (
    impact_laws,
    rebound_laws,
    rebound_ratio,
    resting_depth,
)
from veca_marl.sim.physics import PropShape


@pytest.mark.parametrize("shape", [PropShape.sphere, PropShape.box, PropShape.capsule])
@pytest.mark.parametrize("substeps", [5, 20])
def test_collisions_conserve_momentum_and_add_no_energy(shape, substeps):
    assert not [law for law in impact_laws(substeps, shape) if not law.holds]


@pytest.mark.parametrize("substeps", [5, 40])
def test_a_ball_rebounds_alike_at_every_time_step(substeps):
    """With a constant detection distance some balls do not rebound at all at 1 ms."""
    ratios = [rebound_ratio(substeps, 0.3, height_m) for height_m in (0.35, 0.4, 0.45, 0.55)]
    assert not [law for law in rebound_laws(substeps, 0.3, ratios) if not law.holds]


@pytest.mark.parametrize("substeps", [5, 40])
def test_a_ball_rests_on_the_floor_at_every_time_step(substeps):
    assert resting_depth(substeps) == pytest.approx(0.0, abs=1e-4)
