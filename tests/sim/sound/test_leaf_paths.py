"""Leaves of doors among the obstacles of sound, by themselves."""

import numpy as np
import pytest
from refusals import naming

from veca_marl.sim.geometry import Pose
from veca_marl.sim.sound import House, Room
from veca_marl.sim.sound.obstacles import Obstacles

HALF = (0.02, 0.5, 1.0)
ONE, OTHER = np.array([-1.0, 0.1, 0.0]), np.array([1.0, -0.1, 0.0])
AT_ORIGIN, AWAY = Pose(np.zeros(3), np.eye(3)), Pose(np.array([0.0, 9.0, 0.0]), np.eye(3))


def move(obstacles, number, now, closed):
    obstacles.move_leaf(number, *now)
    obstacles.move_opening(number, *closed)


def test_a_leaf_inside_one_room_attenuates_as_the_same_box_does():
    rooms = [Room((-3.0, -3.0, -1.0), (6.0, 6.0, 2.5))]
    house, as_box = House(rooms, 2, 30.0), House(rooms, 2, 30.0)
    leaf = house.obstacles.add_leaf((0.02, 2.0, 1.0))
    head = Pose(OTHER, np.eye(3))
    as_box.obstacles.add((0.02, 2.015, 1.015))  # with the rebate of its frame
    move(house.obstacles, leaf, AT_ORIGIN, AT_ORIGIN)
    closed = house.arrivals(ONE, head).energies
    np.testing.assert_allclose(closed, as_box.arrivals(ONE, head).energies, rtol=1e-9)
    assert closed[0, 0] < 0.7


def test_a_leaf_round_the_source_or_the_head_does_not_count():
    house = House([Room((-3.0, -3.0, -1.0), (6.0, 6.0, 2.5))])
    house.obstacles.add_leaf(HALF)
    assert (house.direct_energy(np.zeros(3), OTHER) == 1.0).all()
    assert (house.direct_energy(ONE, np.array([0.0, 0.2, 0.5])) == 1.0).all()
    assert house.direct_energy(ONE, OTHER).max() < 1.0


def test_only_a_change_of_a_pose_of_a_leaf_is_a_change():
    obstacles = Obstacles()
    number = obstacles.add_leaf(HALF)
    before = obstacles.changes
    for now, closed, changes in (
        (AT_ORIGIN, AT_ORIGIN, 0),
        (AWAY, AT_ORIGIN, 1),
        (AWAY, AWAY, 2),
        (AWAY, AWAY, 2),
    ):
        move(obstacles, number, now, closed)
        assert obstacles.changes == before + changes


@pytest.mark.parametrize("half", [(1.0, 1.0), (1.0, 0.0, 1.0), (1.0, np.nan, 1.0)])
def test_impossible_leaves_are_refused(half):
    with pytest.raises(ValueError, match=naming(f"half={half}")):
        Obstacles().add_leaf(half)
