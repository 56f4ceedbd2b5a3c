"""Occupancy of the floor and shortest paths over it."""

import math

import numpy as np
import pytest
from walking import ball, box, empty_world, wall

from veca_marl.envs.tasks.floors.grid_paths import Detour, FloorGrid, PathsTo, free_cells, outside

GRID = FloorGrid(np.array([-2.0, -2.0]), (40, 40))
CLEAR_M = 0.15


def walk(paths, start, goal, step_m=0.04):
    """Follow a path; return the places on the way."""
    places = [np.array(start)]
    for _ in range(400):
        here = places[-1]
        if math.dist(here, goal) < 0.05:
            return np.array(places)
        way = paths.next_point(here) - here
        places.append(here + way * min(1.0, step_m / np.linalg.norm(way)))
    raise AssertionError(f"still at {here}")


def length_m(places):
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def test_free_cells_are_those_at_a_distance_from_props():
    turned = box(edges_m=(1.0, 0.4, 0.3), position=(0.5, 0.3, 0.15), yaw_deg=30.0)
    lintel = box("lintel", (1.0, 1.0, 0.3), position=(-1.0, -1.0, 2.0))
    mark = box("mark", (1.0, 1.0, 0.01), 0.0, (-1.0, 1.0, 0.0), tangible=False)
    world = empty_world(turned, lintel, mark)
    free = free_cells(GRID, world, CLEAR_M)
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    own = (GRID.centres - (0.5, 0.3)) @ np.array([[c, -s], [s, c]])
    beyond = np.maximum(np.abs(own) - (0.5, 0.2), 0.0)
    np.testing.assert_array_equal(free, np.linalg.norm(beyond, axis=-1) >= CLEAR_M)
    assert free_cells(GRID, world, CLEAR_M, passable=[world.prop("box")]).all()
    world.close()


def test_a_path_leads_round_a_wall():
    world = empty_world(wall(length_m=2.0, position=(0.0, 0.0, 0.0)))
    free = free_cells(GRID, world, CLEAR_M)
    goal = np.array([1.0, 0.0])
    places = walk(PathsTo(GRID, free, goal), (-1.0, 0.0), goal)
    beside_the_wall = np.abs(places[:, 0]) < 0.05
    assert np.abs(places[beside_the_wall, 1]).min() > 1.1
    shortest_m = 2.0 * math.hypot(0.8, 1.15) + 0.4
    assert length_m(places) == pytest.approx(shortest_m, rel=0.06)
    world.close()


def test_a_straight_path_is_straight():
    goal = np.array([1.5, 0.7])
    places = walk(PathsTo(GRID, np.ones(GRID.shape, bool), goal), (-1.5, -1.0), goal)
    assert length_m(places) == pytest.approx(math.hypot(3.0, 1.7), rel=0.03)


def test_a_path_leads_round_discs():
    free = outside(GRID, [Detour(np.array([0.0, 0.1]), 0.6)])
    goal = np.array([1.5, 0.0])
    places = walk(PathsTo(GRID, free, goal), (-1.5, 0.0), goal)
    assert np.linalg.norm(places - (0.0, 0.1), axis=1).min() > 0.53
    assert places[:, 1].min() < -0.4  # on the shorter side


def test_start_and_goal_may_be_beside_a_prop():
    world = empty_world(ball(radius_m=0.3, mass_kg=0.0, position=(0.0, 0.0, 0.3)))
    free = free_cells(GRID, world, CLEAR_M)
    goal = np.array([0.32, 0.0])
    paths = PathsTo(GRID, free, goal)
    places = walk(paths, (-0.32, 0.0), goal)
    assert np.linalg.norm(places, axis=1).min() > 0.2
    assert paths.length_m((-1.0, 0.0)) > 100.0 > paths.length_m((0.35, 0.05))
    world.close()
