"""Touch on the articulated body is independent of the time step and encodes weight."""

import importlib.util
import sys

import numpy as np
import pytest
from paths import ROOT
from touching import of_bone

from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.physics import GRAVITY_MPS2, ClockCfg

SCRIPT = ROOT / "scripts/make_touch_proof.py"
_SPEC = importlib.util.spec_from_file_location("make_touch_proof", SCRIPT)
proof = importlib.util.module_from_spec(_SPEC)
sys.modules[_SPEC.name] = proof  # dataclasses look their module up
_SPEC.loader.exec_module(proof)

MASSES_KG = (0.05, 0.2, 0.5, 1.5)
BALLS = [proof.Ball(mass) for mass in MASSES_KG]


def rest(vice, spot, ball):
    """The largest reading under a ball at rest on a spot."""
    vice.press(0.8, 0.0, (spot, ball), watch=False)
    return of_bone(vice.read(), spot.bone).max()


def readings_at_rest(clocks):
    """Readings of each spot under each ball at rest, for the time steps of the clocks."""
    readings = {spot: [] for spot in (proof.PALM, proof.FOREARM)}
    for clock in clocks:
        vice = proof.Vice(clock, *BALLS)
        for spot, rows in readings.items():
            rows.append([rest(vice, spot, ball) for ball in BALLS])
        vice.world.close()
    return {spot.bone: np.array(rows) for spot, rows in readings.items()}


@pytest.fixture(scope="module")
def at_rest():
    """The readings for time steps of 8 and 2 ms."""
    return readings_at_rest(proof.clocks(0.02)[::2])


def check_independence(readings):
    assert readings.min() > 0.02
    assert (readings.max(axis=0) / readings.min(axis=0) < 1.01).all()


@pytest.mark.parametrize("bone", ["l_hand", "l_forearm"])
def test_touch_at_rest_is_independent_of_the_time_step(at_rest, bone):
    check_independence(at_rest[bone])


@pytest.mark.slow
def test_touch_at_rest_is_independent_of_all_time_steps_from_8_to_1_ms():
    for readings in readings_at_rest(proof.clocks(0.02)).values():
        check_independence(readings)


def test_compliant_skin_distinguishes_masses_and_rigid_bone_does_not(at_rest):
    light, *_, heavy = at_rest["l_hand"][0]
    assert light < 0.05
    assert heavy > 0.9
    assert (np.diff(at_rest["l_hand"], axis=1) > 0.1).all()
    assert at_rest["l_forearm"].min() > 0.95


def test_the_reading_on_the_palm_is_weight_over_stiffness():
    """T = m g / (k d_max), and k d_max is the force that reaches the bone.

    The nearest taxel is 2.4 mm beside the middle of the ball, where it presses 0.04 mm less.
    """
    bone = load_skeleton().bones[load_skeleton().bone("l_hand")]
    balls = [proof.Ball(mass_kg, 0.07) for mass_kg in (0.1, 0.2, 0.3, 0.5)]
    vice = proof.Vice(ClockCfg(), *balls)
    for ball in balls:
        weight_n = ball.mass_kg * GRAVITY_MPS2
        (press,) = vice.press(0.8, 0.0, (proof.PALM, ball))
        assert press.force_n[-1] == pytest.approx(weight_n, rel=1e-3)
        assert press.touch[-1] == pytest.approx(weight_n / bone.skin_force_n, abs=0.015)
    vice.world.close()


@pytest.mark.parametrize("mass_kg", [0.2, 0.5])
def test_the_peak_of_an_impact_is_stable_with_a_larger_contact_margin(mass_kg):
    touch, force = proof.peaks(proof.PALM, proof.Ball(mass_kg), proof.clocks(0.1))
    assert touch.min() > 0.3
    assert touch.max() / touch.min() < 1.4
    assert force.max() / force.min() > touch.max() / touch.min()


def test_the_peak_of_a_slow_impact_is_stable_by_default():
    """1.6 mm in the longest step, less than half of the skin."""
    touch, _ = proof.peaks(proof.PALM, proof.Ball(0.2), proof.clocks(0.02), fall_m=0.002)
    assert touch.max() / touch.min() < 1.2


def test_on_rigid_bone_the_force_grows_as_the_step_shrinks_and_touch_does_not():
    touch, force = proof.peaks(proof.FOREARM, proof.Ball(0.2), proof.clocks(0.02))
    assert force.max() / force.min() > 4.0
    assert touch.max() / touch.min() < 1.05


def test_readings_of_two_contacts_are_the_sum_of_each_alone():
    balls = [proof.Ball(0.2), proof.Ball(0.3)]
    spots = [proof.PALM, proof.RIGHT_PALM]
    vice = proof.Vice(ClockCfg(), *balls)
    pairs = list(zip(spots, balls, strict=True))
    left, right = (vice.press(0.6, 0.0, pair)[0].readings for pair in pairs)
    both = vice.press(0.6, 0.0, *pairs)[0].readings
    vice.world.close()
    assert of_bone(left, "l_hand").any()
    assert not of_bone(left, "r_hand").any()
    assert not ((left > 0.0) & (right > 0.0)).any()
    np.testing.assert_allclose(both, left + right, atol=0.005)


def test_without_contact_readings_are_exactly_zero():
    ball = proof.Ball()
    vice = proof.Vice(ClockCfg(), ball)
    (press,) = vice.press(0.2, 3.0, (proof.PALM, ball))
    vice.world.close()
    assert not press.touch.any()
    assert not press.force_n.any()
