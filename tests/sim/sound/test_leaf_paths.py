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


def random_pose(rng):
    rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return Pose(rng.uniform(-0.5, 0.5, 3), np.ascontiguousarray(rotation))


@pytest.mark.parametrize(
    ("now", "closed", "count"),
    [(AT_ORIGIN, AT_ORIGIN, 1), (AWAY, AT_ORIGIN, 0), (AT_ORIGIN, AWAY, 0), (AWAY, AWAY, 0)],
)
def test_a_leaf_counts_for_paths_that_pass_it_now_and_would_pass_it_closed(now, closed, count):
    obstacles = Obstacles()
    move(obstacles, obstacles.add_leaf(HALF), now, closed)
    assert obstacles.between(ONE, OTHER) == count
    assert len(obstacles) == 1


@pytest.mark.parametrize("x", [0.0, 0.05, 0.11])
def test_a_leaf_beside_a_wall_is_one_partition_with_it_and_apart_another_one(x):
    obstacles = Obstacles()
    obstacles.move(obstacles.add((0.05, 2.0, 1.0)), (x, 0.0, 0.0), np.eye(3))
    obstacles.add_leaf(HALF)
    assert obstacles.between(ONE, OTHER) == 1
    obstacles.move(0, (0.5, 0.0, 0.0), np.eye(3))
    assert obstacles.between(ONE, OTHER) == 2


def test_leaves_are_symmetric_and_never_attenuate_more_than_closed():
    rng = np.random.default_rng(0)
    passed = 0
    for _ in range(300):
        open_, shut = Obstacles(), Obstacles()
        wall = random_pose(rng), rng.uniform(0.05, 0.6, 3)
        leaf, closed, half = random_pose(rng), random_pose(rng), rng.uniform(0.3, 0.9, 3)
        for obstacles, now in ((open_, leaf), (shut, closed)):
            obstacles.move(obstacles.add(wall[1]), *wall[0])
            move(obstacles, obstacles.add_leaf(half), now, closed)
        # outside of all boxes
        one, other = rng.uniform((-3.0, -1.0, -1.0), (-2.5, 1.0, 1.0), (2, 3))
        other[0] += 5.5
        assert open_.between(one, other) == open_.between(other, one)
        assert open_.between(one, other) <= shut.between(one, other)
        passed += shut.between(one, other)
    assert passed > 50


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
    obstacles = Obstacles()
    obstacles.add_leaf(HALF)
    assert obstacles.between(np.zeros(3), OTHER) == 0
    assert obstacles.between(ONE, np.array([0.0, 0.2, 0.5])) == 0


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
