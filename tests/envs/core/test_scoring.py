"""Quantities that reward terms are composed of."""

import numpy as np
import pytest

from veca_marl.envs.core.task import clipped_share, cosine, horizontal, rotation_angle_rad
from veca_marl.sim.geometry import rotation_about_vertical

EAST, NORTH = np.array([1.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        (EAST, 3.0 * EAST, 1.0),
        (EAST, -EAST, -1.0),
        (EAST, NORTH, 0.0),
        (EAST, 2.0 * EAST + NORTH, np.sqrt(0.5)),
        (EAST, np.zeros(3), 0.0),
        (np.zeros(3), np.zeros(3), 0.0),
    ],
)
def test_cosine(a, b, expected):
    assert cosine(a, b) == pytest.approx(expected)
    assert cosine(b, a) == pytest.approx(expected)


def test_horizontal_sets_the_vertical_component_to_zero_in_a_copy():
    vector = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(horizontal(vector), (1.0, 2.0, 0.0))
    np.testing.assert_array_equal(vector, (1.0, 2.0, 3.0))


@pytest.mark.parametrize(("value", "expected"), [(-1.0, 0.0), (0.5, 0.25), (2.0, 1.0), (3.0, 1.0)])
def test_clipped_share(value, expected):
    assert clipped_share(value, 2.0) == expected


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, np.pi])
def test_rotation_angle(angle):
    # a common turn of both changes nothing
    tilt = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    turned = rotation_about_vertical(angle)
    assert rotation_angle_rad(np.eye(3), turned) == pytest.approx(abs(angle), abs=1e-7)
    assert rotation_angle_rad(tilt, tilt @ turned) == pytest.approx(abs(angle), abs=1e-7)
