"""Joint limits are never exceeded in Bullet, and the mass matrix is that of Bullet."""

import pytest

from tools.fidelity.mechanics.joints import (
    drive_against_limits,
    inertia_law,
    limit_laws,
    matrix_law,
)
from veca_marl.sim.body.humanoid import Detail


@pytest.mark.parametrize("detail", Detail)
def test_the_mass_matrix_is_that_of_bullet(detail):
    assert matrix_law(detail, 3).holds


@pytest.mark.parametrize("detail", Detail)
def test_the_inertia_about_the_long_axis_is_that_of_the_bones_but_for_a_seventh(detail):
    assert inertia_law(detail).holds


def test_no_joint_passes_a_limit():
    assert not [law for law in limit_laws(Detail.mitten, 0.4) if not law.holds]


def test_many_joints_reach_their_limits():
    assert drive_against_limits(Detail.mitten, 0, 1.0).at_limits > 20
