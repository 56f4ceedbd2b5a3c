"""Inertia of props against theory."""

import pytest

from tools.fidelity.mechanics.inertia import SIZES, inertia_laws, pendulum_law


@pytest.mark.parametrize("shape", SIZES)
def test_a_prop_has_the_inertia_of_a_homogeneous_solid(shape):
    """Bullet alone gives capsules and goals the inertia of their bounding box."""
    assert not [law for law in inertia_laws(shape) if not law.holds]


def test_a_rod_swings_with_the_period_of_a_physical_pendulum():
    assert pendulum_law(5).holds
