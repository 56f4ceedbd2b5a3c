"""The gait on two feet: its symmetry, and what its parts do."""

import math
from dataclasses import replace

import pytest

from veca_marl.envs.experts.control.stepping import Balance, SteppingPattern, arm, leg

PATTERN = SteppingPattern()
UPRIGHT = Balance((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))


def mirrored(balance):
    left, yaw = balance.left, balance.yaw
    return balance._replace(left=(-left[0], -left[1]), yaw=(-yaw[0], -yaw[1]))


@pytest.mark.parametrize("phase", [0.0, 1.0, 2.5, 4.0])
def test_a_mirrored_body_moves_its_other_leg_in_the_same_way(phase):
    balance = Balance((0.02, 0.3), (0.01, -0.2), (0.1, 1.0), (0.2, -0.5))
    left = leg(PATTERN, balance, 1.0, phase, 1.0)
    assert leg(PATTERN, mirrored(balance), -1.0, phase, 1.0) == pytest.approx(left)


def test_without_steps_an_upright_body_stands_still():
    first, later = (leg(PATTERN, UPRIGHT, 1.0, phase, 0.0) for phase in (0.0, 2.0))
    assert first == later
    assert first["thigh.flexion"] == PATTERN.hip
    assert arm(PATTERN, 0.0, 0.0) == arm(PATTERN, 2.0, 0.0)


def test_feet_press_their_toes_down_when_the_trunk_is_ahead_of_them():
    ahead = leg(PATTERN, UPRIGHT._replace(ahead=(0.02, 0.0)), 1.0, 0.0, 0.0)
    assert ahead["foot.dorsiflexion"] < PATTERN.ankle - 5.0


def test_a_leg_is_lifted_in_one_half_of_its_period():
    flat = replace(PATTERN, lift_lead_rad=0.0)
    knee = [leg(flat, UPRIGHT, 1.0, phase, 1.0)["shank.flexion"] for phase in (math.pi / 2, 4.0)]
    assert knee == pytest.approx([flat.knee + flat.knee_lift, flat.knee])
