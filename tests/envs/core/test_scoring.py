"""The words of rewards."""

import numpy as np
import pytest

from veca_marl.envs.core.scoring import along, angle_between_rad, cosine, flat, share
from veca_marl.sim.geometry.rotations import turn_about_vertical

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


def test_flat_drops_the_height_and_leaves_its_argument():
    vector = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(flat(vector), (1.0, 2.0, 0.0))
    np.testing.assert_array_equal(vector, (1.0, 2.0, 3.0))


@pytest.mark.parametrize(("value", "expected"), [(-1.0, 0.0), (0.5, 0.25), (2.0, 1.0), (3.0, 1.0)])
def test_a_share_is_never_more_than_all(value, expected):
    assert share(value, 2.0) == expected


@pytest.mark.parametrize(
    ("way", "expected"),
    [(0.1 * EAST, 0.5), (-0.1 * EAST, -0.5), (EAST, 2.0), (-EAST, -2.0), (NORTH, 0.0)],
)
def test_speed_along_a_direction_is_cut_at_the_top(way, expected):
    assert along(way, EAST, time_s=0.2, top_mps=2.0) == pytest.approx(expected)


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, np.pi])
def test_the_angle_between_orientations(angle):
    # a common turn of both changes nothing
    tilt = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    turned = turn_about_vertical(angle)
    assert angle_between_rad(np.eye(3), turned) == pytest.approx(abs(angle), abs=1e-7)
    assert angle_between_rad(tilt, tilt @ turned) == pytest.approx(abs(angle), abs=1e-7)
