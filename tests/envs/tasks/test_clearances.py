"""Clear floor between props: leaving out distant props gives the same answers as measuring all."""

import math

import numpy as np
import pytest
from seeking import shipped
from walking import box, empty_world

from veca_marl.envs.tasks.floors.places import (
    Clearances,
    Spacing,
    clearances_m,
    furniture_of,
    scattered_places,
)
from veca_marl.sim.physics import World

CLEAR_M = 0.5


@pytest.fixture(scope="module")
def house():
    world = World(shipped("house2"))
    yield world
    world.close()


def same_answers(props, points, clear_m=CLEAR_M):
    """Compare with the distances to all props; return how many of the points are clear."""
    measured = [clearances_m(prop, points) for prop in props]
    expected = np.min(measured, axis=0) >= clear_m
    clearances = Clearances(props)
    found = [clearances.all_at_least(point, clear_m) for point in points]
    np.testing.assert_array_equal(found, expected)
    return int(expected.sum())


def test_all_furniture_of_a_house_with_doors_at_any_opening(house):
    rng, furniture = np.random.default_rng(0), furniture_of(house)
    doors = [prop for prop in furniture if prop.joint is not None]
    assert doors
    for opening in (0.0, 0.4, 1.0):
        for door in doors:
            door.set_opening(opening)
        clear = same_answers(furniture, rng.uniform((-6.4, -2.5), (7.0, 8.3), (60, 2)))
        assert 10 < clear < 50


def test_props_that_are_placed_elsewhere_count_where_they_are_now(house):
    rng, furniture = np.random.default_rng(1), furniture_of(house)
    table = house.prop("table")
    before = table.position
    for number in range(3):
        table.place((number - 1.0, 0.5 * number, before[2]), yaw_rad=0.7 * number)
        assert not Clearances(furniture).all_at_least(table.position[:2], 0.1)
        spacing = Spacing(0.3, 0.3, 0.0)
        for place in scattered_places(house.playground, furniture, 20, spacing, rng):
            assert clearances_m(table, place[:2]) >= 0.3
    table.place(before, 0.0)


def test_a_pole_that_lies_on_the_floor_is_as_long_as_it_is():
    """The circle about an upright pole does not contain it."""
    world = empty_world(box("pole", (0.1, 0.1, 2.0), 1.0, (0.0, 0.0, 1.0)))
    pole = world.prop("pole")
    row = world.scene.objects[pole.object_id].rows.start
    tilt = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    world.scene.rotations[row], world.scene.positions[row] = tilt, (0.0, 0.0, 0.05)
    points = np.array([[x, 0.2] for x in np.linspace(-1.5, 1.5, 13)])
    assert 0 < same_answers([pole], points, 0.3) < 13


def test_a_line_is_clear_if_all_of_its_points_are():
    world = empty_world(box("cube", (0.2, 0.2, 0.8), 0.0, (1.0, 0.0, 0.4)))
    clearances = Clearances(list(world.props.values()))
    line = np.array([[x, 0.0] for x in (0.0, 0.4, 0.8)])
    assert clearances.all_at_least(line[:2], 0.3)
    assert not clearances.all_at_least(line, 0.3)
    assert not clearances.all_at_least(line[1], 0.5 + math.ulp(1.0))
    assert Clearances([]).all_at_least(line, 0.3)
