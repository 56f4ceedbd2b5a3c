"""How many boxes a straight line passes."""

import numpy as np
import pytest

from veca_marl.sim.sound.blocked_paths import count_crossed, crosses_box


def wall(x, height=3.0):
    return np.array([x, 1.0, 0.5 + height / 2]), np.eye(3), np.array([0.05, 3.0, height / 2])


def test_a_path_through_a_wall_is_symmetric():
    one, other, box = np.array([0.0, 0.2, 0.1]), np.array([3.0, 0.4, 0.9]), wall(1.5)
    assert crosses_box(one, other, *box)
    assert crosses_box(other, one, *box)


def pieces_of_a_wall():
    """A wall in the plane x = 1.5 with an opening from y = 0 to 1 below z = 2."""
    boxes = [((-2.0, 0.0), (0.0, 3.0)), ((1.0, 3.0), (0.0, 3.0)), ((0.0, 1.0), (2.0, 3.0))]
    centres = np.array([(1.5, sum(y) / 2, sum(z) / 2) for y, z in boxes])
    halves = np.array([(0.05, (y[1] - y[0]) / 2, (z[1] - z[0]) / 2) for y, z in boxes])
    return centres, np.repeat(np.eye(3)[None], 3, axis=0), halves


@pytest.mark.parametrize(
    ("one", "other", "walls"),
    [
        ((0.0, 0.2, 2.5), (3.0, 0.4, 2.5), 1),  # above the opening
        ((0.0, -0.6, 2.4), (3.0, 0.6, 2.4), 1),  # from beside it to above it, within the wall
        ((0.0, 1.6, 2.4), (3.0, 0.4, 2.4), 1),
        ((0.0, 0.2, 1.0), (3.0, 0.4, 1.0), 0),  # through the opening
    ],
)
def test_the_pieces_of_one_wall_count_once(one, other, walls):
    assert count_crossed(np.array(one), np.array(other), *pieces_of_a_wall()) == walls
    assert count_crossed(np.array(other), np.array(one), *pieces_of_a_wall()) == walls


def test_two_walls_one_behind_the_other_count_twice():
    centres, rotations, halves = (np.concatenate([part, part]) for part in pieces_of_a_wall())
    centres[3:, 0] += 1.0
    ends = np.array([0.0, -1.0, 1.0]), np.array([4.0, -1.2, 1.0])
    assert count_crossed(*ends, centres, rotations, halves) == 2
