"""Courses of a walker end at furniture."""

import numpy as np
import pytest
from seeking import walker_at

from veca_marl.envs.experts.cars import ObstructedCourses
from veca_marl.sim.physics import PlaygroundCfg, PropCfg, PropShape, RoomCfg, World

EDGE_M = 0.5  # the near face of the box is at x = 0.75 m


@pytest.fixture(params=[0.0, 20.0, 1.0], ids=["fixed", "heavy", "light"])
def world(request):
    box = PropCfg(
        name="box",
        shape=PropShape.box,
        size_m=[EDGE_M] * 3,
        position_m=(1.0, 0.0, EDGE_M / 2.0),
        mass_kg=request.param,
    )
    room = RoomCfg(lower_m=(-2.0, -2.0, 0.0), size_m=(4.0, 4.0, 2.6))
    world = World(PlaygroundCfg(name="den", rooms=[room], props=[box]))
    yield world, request.param == 1.0
    world.close()


def straight(start, way, steps=40):
    """Return one course ``(1, steps, 2)`` that leads straight along a way."""
    return (np.array(start) + np.linspace(1 / steps, 1, steps)[:, None] * way)[None]


def test_a_course_ends_where_a_walker_meets_the_box_and_not_at_a_light_one(world):
    world, is_light = world
    walker = walker_at(world, 0.0, 0.0)
    course = straight((0.0, 0.0), (1.5, 0.0))
    held = ObstructedCourses(walker, world).held(walker.position, course)
    if is_light:
        np.testing.assert_array_equal(held, course)
        return
    for _ in range(50):
        walker.act(walker.encode((1.0, 0.0)))
        world.step()
    assert held[0, -1] == pytest.approx(walker.position[:2], abs=0.08)
    assert (np.diff(held[0, :, 0]) >= 0.0).all()
    np.testing.assert_array_equal(held[0, :10], course[0, :10])


def test_a_walker_beside_the_box_can_walk_away_and_along_it(world):
    world, _ = world
    walker, start = walker_at(world, 0.63, 0.0), (0.63, 0.0)
    courses = np.concatenate([straight(start, (-1.0, 0.0)), straight(start, (0.0, 1.0))])
    held = ObstructedCourses(walker, world).held(walker.position, courses)
    np.testing.assert_array_equal(held, courses)


def test_without_furniture_courses_stay_as_they_are():
    room = RoomCfg(lower_m=(-2.0, -2.0, 0.0), size_m=(4.0, 4.0, 2.6))
    world = World(PlaygroundCfg(name="den", rooms=[room]))
    walker, course = walker_at(world, 0.0, 0.0), straight((0.0, 0.0), (1.5, 1.5))
    held = ObstructedCourses(walker, world).held(walker.position, course)
    np.testing.assert_array_equal(held, course)
    world.close()
