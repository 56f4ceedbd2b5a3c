"""Signed distances to primitives, against points on their surfaces and their own gradients."""

import numpy as np
import pytest

from veca_marl.sim.geometry import (
    Primitive,
    Shape,
    distance,
    distance_and_gradient,
    distances_to,
    is_inside,
)

SIZES = {
    Shape.SPHERE: (0.3,),
    Shape.BOX: (0.2, 0.3, 0.4),
    Shape.CYLINDER: (0.2, 0.5),
    Shape.CAPSULE: (0.2, 0.5),
}


def surface_points(shape, size, ways):
    """Where rays ``(N, 3)`` out of the middle of a primitive leave it."""
    ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    x, y, z = np.abs(ways).T
    across = np.hypot(x, y)
    with np.errstate(divide="ignore"):
        if shape is Shape.SPHERE:
            t = np.full(len(ways), size[0])
        elif shape is Shape.BOX:
            t = np.min(np.divide(size, np.abs(ways)), axis=1)
        elif shape is Shape.CYLINDER:
            t = np.minimum(size[0] / across, size[1] / 2 / z)
        else:
            half = size[1] / 2
            t = size[0] / across
            capped = t * z > half
            cap = z * half + np.sqrt(np.maximum(size[0] ** 2 - (across * half) ** 2, 0))
            t[capped] = cap[capped]
    return ways * t[:, None]


@pytest.mark.parametrize("shape", SIZES)
def test_distance_is_that_to_the_nearest_surface_point(shape):
    size = np.zeros(3, np.float32)
    size[: len(SIZES[shape])] = SIZES[shape]
    ways = np.random.default_rng(0).normal(size=(200_000, 3))
    surface = surface_points(shape, SIZES[shape], ways)
    for point in np.random.default_rng(1).uniform(-1, 1, (60, 3)):
        boundary = np.linalg.norm(surface_points(shape, SIZES[shape], point[None]))
        nearest = np.linalg.norm(surface - point, axis=1).min()
        got = distance(int(shape), tuple(size), *point)
        assert (got <= 0.0) == (np.linalg.norm(point) <= boundary)
        # the points are some millimetres apart
        assert got <= 0.0 or got - 1e-6 <= nearest <= got + 0.012


@pytest.mark.parametrize("shape", SIZES)
def test_the_gradient_is_that_of_the_distance(shape):
    size = (*SIZES[shape], 0.0, 0.0)[:3]
    step = 1e-6
    for point in np.random.default_rng(3).uniform(-0.6, 0.6, (200, 3)):
        here, *slope = distance_and_gradient(int(shape), size, *point)
        there = distance_and_gradient(int(shape), size, *(point + step * np.array(slope)))[0]
        assert np.linalg.norm(slope) == pytest.approx(1.0, abs=1e-9)
        assert there - here == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("shape", SIZES)
def test_all_ways_to_ask_for_a_distance_agree(shape):
    size = (*SIZES[shape], 0.0, 0.0)[:3]
    points = np.random.default_rng(4).uniform(-0.6, 0.6, (200, 3))
    many = distances_to(Primitive(shape, SIZES[shape]), points)
    for point, expected in zip(points, many, strict=True):
        ways = (
            distance(int(shape), size, *point),
            distance_and_gradient(int(shape), size, *point)[0],
        )
        assert ways == pytest.approx((expected, expected), abs=1e-15)
        assert is_inside(int(shape), size, *point) == (expected < 0.0)
