import math

import numpy as np
import pytest

from veca_marl.sim.geometry import (
    matrix_to_quaternion,
    quaternion_from_yaw,
    quaternions_to_matrices,
    rotation_about_vertical,
)
from veca_marl.sim.physics import pybullet


def unit_quaternions(count):
    quaternions = np.random.default_rng(0).normal(size=(count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def matrices(quaternions):
    out = np.empty((len(quaternions), 3, 3))
    quaternions_to_matrices(quaternions, out)
    return out


def test_matrices_are_bit_equal_to_bullets():
    quaternions = unit_quaternions(500)
    for quaternion, matrix in zip(quaternions, matrices(quaternions), strict=True):
        expected = np.reshape(pybullet.getMatrixFromQuaternion(quaternion), (3, 3))
        np.testing.assert_array_equal(matrix, expected)


def test_matrix_to_quaternion_is_the_inverse():
    half_turns = np.eye(4)[:3]
    nearly = half_turns + 1e-9
    quaternions = np.concatenate((unit_quaternions(200), np.eye(4), nearly))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    for quaternion, matrix in zip(quaternions, matrices(quaternions), strict=True):
        back = matrix_to_quaternion(matrix)
        assert back[3] >= 0.0
        assert abs(back @ quaternion) == pytest.approx(1.0, abs=1e-12)


def test_yaw_turns_forward_to_the_left():
    (matrix,) = matrices(np.array([quaternion_from_yaw(math.pi / 2)]))
    np.testing.assert_allclose(matrix @ (1, 0, 0), (0, 1, 0), atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
def test_a_turn_about_the_vertical_is_that_of_its_quaternion(yaw):
    expected = matrices(np.array([quaternion_from_yaw(yaw)]))[0]
    np.testing.assert_allclose(rotation_about_vertical(yaw), expected, atol=1e-12)
