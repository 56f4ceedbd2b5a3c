"""How far it is to things along a ray, whatever the order in which they were added."""

from itertools import permutations

import numpy as np
import pytest

from veca_marl.sim.physics.bullet import free_path_m, surface_m
from veca_marl.sim.physics.bullet_client import pybullet

HALF_M, CLEARANCE_M = 0.1, 0.05
NEAREST_M = (0.5, 1.0, 1.5)
START, END = np.zeros(3), np.array([3.0, 0.0, 0.0])


def add_cube(client, x_m):
    """Add a fixed cube; its face towards the origin is at `x_m`."""
    shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[HALF_M] * 3)
    return client.createMultiBody(0.0, shape, basePosition=(x_m + HALF_M, 0.0, 0.0))


@pytest.mark.parametrize("order", list(permutations(NEAREST_M)))
def test_the_nearest_of_several_things_ends_a_free_path(client, order):
    cubes = {x_m: add_cube(client, x_m) for x_m in order}
    free_m = free_path_m(client, START, END, CLEARANCE_M, ignored_id=-2)
    assert free_m == pytest.approx(NEAREST_M[0] - CLEARANCE_M, abs=1e-6)
    beyond_m = free_path_m(client, START, END, CLEARANCE_M, ignored_id=cubes[NEAREST_M[0]])
    assert beyond_m == pytest.approx(NEAREST_M[1] - CLEARANCE_M, abs=1e-6)
    for x_m, cube in cubes.items():
        assert surface_m(client, cube, START, END) == pytest.approx(x_m, abs=1e-6)


def test_more_things_than_a_room_holds_hide_none(client):
    for x_m in np.arange(2.5, 0.4, -0.25):
        add_cube(client, float(x_m))
    free_m = free_path_m(client, START, END, CLEARANCE_M, ignored_id=-2)
    assert free_m == pytest.approx(0.5 - CLEARANCE_M, abs=1e-6)


@pytest.mark.parametrize("sides", list(permutations((0.0, 0.4, 0.8))))
def test_the_outermost_part_of_a_body_is_its_surface(client, sides):
    shape = client.createCollisionShapeArray(
        shapeTypes=[pybullet.GEOM_BOX] * 3,
        halfExtents=[[HALF_M] * 3] * 3,
        collisionFramePositions=[[side + HALF_M, 0.0, 0.0] for side in sides],
    )
    body = client.createMultiBody(0.0, shape, basePosition=(1.0, 0.0, 0.0))
    assert surface_m(client, body, START, END) == pytest.approx(1.0, abs=1e-6)


def test_without_a_thing_the_whole_path_is_free(client):
    assert free_path_m(client, START, END, CLEARANCE_M, ignored_id=-2) == 3.0
    cube = add_cube(client, 4.0)
    assert surface_m(client, cube, START, END) == 3.0
