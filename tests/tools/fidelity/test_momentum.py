"""Bodies that nothing touches keep their momentum and gain no energy."""

import numpy as np
import pytest

from tools.fidelity.mechanics.momentum import (
    Flight,
    driven_flight,
    energy_laws,
    fall_laws,
    momentum_laws,
    unpowered_flight,
)
from veca_marl.sim.body.humanoid import Detail


@pytest.mark.parametrize(("detail", "seconds"), [(Detail.mitten, 2.0), (Detail.full, 0.6)])
def test_internal_torques_change_neither_momentum_nor_angular_momentum(detail, seconds):
    laws = list(momentum_laws(detail, driven_flight(detail, 0, seconds)))
    assert not [law for law in laws if not law.holds]


@pytest.mark.parametrize("detail", Detail)
def test_the_centre_of_mass_falls_as_a_stone_does(detail):
    assert not [law for law in fall_laws(detail, 0.4) if not law.holds]


def test_an_unpowered_body_gains_no_energy():
    flights = [unpowered_flight(Detail.mitten, 0, 1.0, 3.0)]
    assert not [law for law in energy_laws(Detail.mitten, flights) if not law.holds]


def test_a_rise_after_a_loss_of_energy_breaks_the_law():
    """The energy stays below the first value."""
    flight = Flight(*np.zeros((3, 4)), np.array([1.0, 0.5, 0.52, 0.4]))
    (law,) = energy_laws(Detail.mitten, [flight])
    assert law.measured == pytest.approx(0.04)
    assert not law.holds
