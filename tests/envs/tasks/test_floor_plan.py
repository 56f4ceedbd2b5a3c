"""Floor plans: paths through doors exist and a walker can follow them."""

import itertools
import math

import numpy as np
import pytest
from refusals import naming
from seeking import shipped, walker_at

from veca_marl.envs.experts.control.locomotion import walk_to
from veca_marl.envs.tasks.floors.floor_plan import DoorApproach, FloorPlan
from veca_marl.sim.physics import DoorCfg, PlaygroundCfg, RoomCfg, World

APPROACH = DoorApproach(before_m=0.4, right_m=0.2)
HOUSES = ("two_rooms", "three_rooms", "four_rooms", "seven_rooms")


def plan_of(*doors, rooms=3):
    """Rooms of 4 x 4 m in a row along x, walls of 0.1 m between."""
    row = [
        RoomCfg(name=str(n), lower_m=(4.1 * n, 0.0, 0.0), size_m=(4.0, 4.0, 2.5))
        for n in range(rooms)
    ]
    openings = [
        DoorCfg(name=f"door_{n}", rooms=(str(n), str(n + 1)), position_m=(4.1 * n + 4.05, y))
        for n, y in enumerate(doors)
    ]
    return FloorPlan(PlaygroundCfg(name="row", rooms=row, doors=openings))


def test_room_of_returns_the_nearest_room():
    plan = plan_of(1.0, 3.0)
    assert [plan.room_of(np.array([x, 2.0])) for x in (-5.0, 2.0, 4.04, 4.06, 10.0)] == [
        *(0, 0, 0, 1, 2)
    ]


def test_distances_are_measured_between_middles_and_doors():
    plan = plan_of(1.0, 3.0)
    half = math.dist((2.0, 2.0), (4.05, 1.0))
    assert plan.distance_m(0, 1) == pytest.approx(2.0 * half)
    assert plan.distance_m(0, 2) == pytest.approx(4.0 * half)
    assert plan.distance_m(2, 0) == pytest.approx(4.0 * half)
    assert plan.distance_m(1, 1) == 0.0


def test_the_waypoint_in_the_same_room_is_the_goal():
    goal = plan_of(1.0, 3.0).waypoint(
        np.array([1.0, 1.0, 0.5]), np.array([3.0, 2.0, 0.5]), APPROACH
    )
    np.testing.assert_array_equal(goal, (3.0, 2.0))


@pytest.mark.parametrize(("begin_x", "goal_x", "side", "right"), [(2, 10, -1, -1), (6, 2, 1, 1)])
def test_waypoints_lead_in_front_of_the_door_and_through_it(begin_x, goal_x, side, right):
    """Keep to the right: towards larger x at smaller y."""
    plan, goal = plan_of(1.0, 3.0), np.array([goal_x, 2.0])
    before = plan.waypoint(np.array([begin_x, 3.5]), goal, APPROACH)
    np.testing.assert_allclose(before, (4.05 + 0.4 * side, 1.0 + 0.2 * right))
    beyond = plan.waypoint(before, goal, APPROACH)
    np.testing.assert_allclose(beyond, (4.05 - 0.4 * side, 1.0 + 0.2 * right))


def test_waypoints_through_the_middle_of_the_door():
    plan, goal = plan_of(1.0, 3.0), np.array([6.0, 2.0])
    wide = DoorApproach(before_m=0.9, right_m=0.0)
    before = plan.waypoint(np.array([2.0, 3.5]), goal, wide)
    np.testing.assert_allclose(before, (4.05 - 0.9, 1.0))
    np.testing.assert_allclose(plan.waypoint(before, goal, wide), (4.05 + 0.9, 1.0))


@pytest.mark.parametrize("place", [(1.0, 1.0), (3.0, 1.0), (2.0, 3.0), (2.0, 2.0)])
def test_the_waiting_place_keeps_away_from_the_goal_and_from_doors(place):
    """The door is at (4.05, 1)."""
    plan = plan_of(1.0, 3.0)
    aside = plan.waiting_place(np.array(place))
    assert plan.rooms[0].contains(np.array([*aside, 1.0]), 0.69)
    assert math.dist(aside, place) > 1.5
    assert math.dist(aside, (4.05, 1.0)) > 2.0


def test_a_goal_without_a_path_is_an_error():
    plan = plan_of(1.0)
    assert plan.distance_m(0, 2) == math.inf
    with pytest.raises(ValueError, match=naming("'0'", "'2'")):
        plan.waypoint(np.array([1.0, 1.0]), np.array([10.0, 1.0]), APPROACH)


@pytest.mark.parametrize("house", HOUSES)
def test_doors_are_openings_of_the_walls(house):
    """No obstacle lies in the opening; walls are beside it and above 2 m."""
    world = World(shipped(house))
    assert world.playground.doors
    for door in world.playground.doors:
        rooms = {room.name: room for room in world.playground.rooms}
        x, y = door.position_m
        along_x = rooms[door.rooms[0]].lower_m[1] == rooms[door.rooms[1]].lower_m[1]
        out = np.array([0.2, 0.0, 0.0] if along_x else [0.0, 0.2, 0.0])
        aside = out[[1, 0, 2]] / 0.2
        for shift_m, height_m, is_open in (
            (0.0, 1.0, True),
            (door.width_m / 2 - 0.1, 1.0, True),
            (0.1 - door.width_m / 2, 1.0, True),
            (door.width_m / 2 + 0.1, 1.0, False),
            (-door.width_m / 2 - 0.1, 1.0, False),
            (0.0, 2.1, False),
        ):
            middle = np.array([x, y, height_m]) + shift_m * aside
            at_8_khz = world.house.direct_energy(middle - out, middle + out)[-1]
            where = (door.name, shift_m, height_m)
            assert at_8_khz > 0.8 if is_open else at_8_khz < 0.1, where
    world.close()


def arrives(world, plan, walker, goal):
    """Walk for at most 20 s; return whether the walker reaches a place."""
    for _ in range(25 * 20):
        walker.act(walker.encode(walk_to(walker, plan.waypoint(walker.position, goal, APPROACH))))
        world.step()
        if math.dist(walker.position[:2], goal[:2]) < 0.2:
            return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize("house", HOUSES)
def test_a_walker_reaches_every_neighbouring_room(house):
    world = World(shipped(house))
    plan, walker = FloorPlan(world.playground), walker_at(world)
    pairs = list(itertools.pairwise(plan.rooms))
    for begin, end in pairs + [(end, begin) for begin, end in pairs]:
        walker.place(tuple(begin.middle_m), 1.0)
        assert arrives(world, plan, walker, end.middle_m), (begin.name, end.name)
    world.close()
