"""Touch on the articulated body is independent of the time step and encodes weight."""

import numpy as np
import pytest
from touching import of_bone

from tools.fidelity.touch import fixed_arms
from tools.fidelity.touch.fixed_arms import FOREARM, PALM, RIGHT_PALM, Ball, FixedArms
from veca_marl.sim.body.anatomy import load_skeleton
from veca_marl.sim.physics import GRAVITY_MPS2, ClockCfg


@pytest.fixture(scope="module")
def at_rest():
    """The readings for time steps of 8 and 2 ms."""
    return fixed_arms.readings_at_rest(fixed_arms.clocks(0.02)[::2])


def check_independence(readings):
    assert min(of_spot.min() for of_spot in readings.values()) > 0.02
    assert not [law for law in fixed_arms.rest_laws(readings) if not law.holds]


@pytest.mark.slow
def test_touch_at_rest_is_independent_of_the_time_step(at_rest):
    check_independence(at_rest)


@pytest.mark.slow
def test_a_reading_that_depends_on_the_time_step_breaks_a_law(at_rest):
    wrong = {**at_rest, "palm": at_rest["palm"] * [[1.0], [1.02]]}
    assert [law.holds for law in fixed_arms.rest_laws(wrong)] == [False, True]


@pytest.mark.slow
def test_touch_at_rest_is_independent_of_all_time_steps_from_8_to_1_ms():
    check_independence(fixed_arms.readings_at_rest(fixed_arms.clocks(0.02)))


@pytest.mark.slow
def test_compliant_skin_distinguishes_masses_and_rigid_bone_does_not(at_rest):
    light, *_, heavy = at_rest["palm"][0]
    assert light < 0.05
    assert heavy > 0.9
    assert (np.diff(at_rest["palm"], axis=1) > 0.1).all()
    assert at_rest["forearm"].min() > 0.95


def test_the_reading_on_the_palm_is_weight_over_stiffness():
    """T = m g / (k d_max), and k d_max is the force that reaches the bone.

    The nearest taxel is 2.4 mm beside the middle of the ball, where it presses 0.04 mm less.
    """
    bone = load_skeleton().bones[load_skeleton().bone("l_hand")]
    balls = [Ball(mass_kg, 0.07) for mass_kg in (0.1, 0.2, 0.3, 0.5)]
    arms = FixedArms(ClockCfg(), *balls)
    for ball in balls:
        weight_n = ball.mass_kg * GRAVITY_MPS2
        (press,) = arms.press(0.8, 0.0, (PALM, ball))
        assert press.force_n[-1] == pytest.approx(weight_n, rel=1e-3)
        assert press.touch[-1] == pytest.approx(weight_n / bone.skin_force_n, abs=0.015)
    arms.world.close()


@pytest.mark.slow
@pytest.mark.parametrize("mass_kg", [0.2, 0.5])
def test_the_peak_of_an_impact_is_stable_with_a_larger_contact_margin(mass_kg):
    touch, force = fixed_arms.peaks(PALM, Ball(mass_kg), fixed_arms.clocks(0.1))
    assert touch.min() > 0.3
    assert touch.max() / touch.min() < 1.4
    assert force.max() / force.min() > touch.max() / touch.min()


def test_the_peak_of_a_slow_impact_is_stable_by_default():
    """1.6 mm in the longest step, less than half of the skin."""
    touch, _ = fixed_arms.peaks(PALM, Ball(0.2), fixed_arms.clocks(0.02), fall_m=0.002)
    assert touch.max() / touch.min() < 1.2


def test_on_rigid_bone_the_force_grows_as_the_step_shrinks_and_touch_does_not():
    touch, force = fixed_arms.peaks(FOREARM, Ball(0.2), fixed_arms.clocks(0.02))
    assert force.max() / force.min() > 4.0
    assert touch.max() / touch.min() < 1.05


def test_readings_of_two_contacts_are_the_sum_of_each_alone():
    balls = [Ball(0.2), Ball(0.3)]
    spots = [PALM, RIGHT_PALM]
    arms = FixedArms(ClockCfg(), *balls)
    pairs = list(zip(spots, balls, strict=True))
    left, right = (arms.press(0.6, 0.0, pair)[0].readings for pair in pairs)
    both = arms.press(0.6, 0.0, *pairs)[0].readings
    arms.world.close()
    assert of_bone(left, "l_hand").any()
    assert not of_bone(left, "r_hand").any()
    assert not ((left > 0.0) & (right > 0.0)).any()
    np.testing.assert_allclose(both, left + right, atol=0.005)


def test_without_contact_readings_are_exactly_zero():
    ball = Ball()
    arms = FixedArms(ClockCfg(), ball)
    (press,) = arms.press(0.2, 3.0, (PALM, ball))
    arms.world.close()
    assert not press.touch.any()
    assert not press.force_n.any()
