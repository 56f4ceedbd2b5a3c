"""Primitives: their points, their mass properties and their descriptions are those of one solid."""

import math

import numpy as np
import pytest
from refusals import naming
from scipy.spatial.transform import Rotation

from veca_marl.sim.geometry import (
    Inertia,
    Pose,
    Primitive,
    Shape,
    capsule_between,
    convex_hull,
    distances_to,
    joined_inertia,
    primitive_inertia,
)

TURN = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
SIZES = {
    Shape.SPHERE: (0.3,),
    Shape.BOX: (0.1, 0.2, 0.3),
    Shape.CYLINDER: (0.2, 0.5),
    Shape.CAPSULE: (0.2, 0.5),
    Shape.POLYHEDRON: (),
}
HULL = convex_hull(np.random.default_rng(5).uniform(-0.25, 0.25, (12, 3)))


def primitive(shape):
    hull = HULL if shape is Shape.POLYHEDRON else None
    return Primitive(shape, SIZES[shape], (0.5, -0.2, 0.1), TURN, hull=hull)


def points_inside(part, count=1_000_000):
    """Points spread evenly over a primitive, which is within a cube of 0.92 m."""
    points = np.random.default_rng(0).uniform(-0.46, 0.46, (count, 3)) + np.asarray(part.offset)
    return points[distances_to(part, points) < 0.0]


@pytest.mark.parametrize("shape", Shape)
def test_inertia_is_that_of_evenly_spread_points(shape):
    part = primitive(shape)
    found = primitive_inertia(part, 2.0)
    points = points_inside(part)
    spread = 2.0 * np.cov(points.T)
    expected = np.trace(spread) * np.eye(3) - spread
    assert found.mass_kg == 2.0
    np.testing.assert_allclose(found.centre, points.mean(axis=0), atol=0.003)
    np.testing.assert_allclose(found.matrix, expected, atol=0.015 * expected.max())


@pytest.mark.parametrize("shape", Shape)
def test_volume_is_that_of_evenly_spread_points(shape):
    part = primitive(shape)
    count = 1_000_000
    share = len(points_inside(part, count)) / count
    five_deviations = 5.0 * math.sqrt((1.0 - share) / (share * count))
    assert part.volume == pytest.approx(share * 0.92**3, rel=five_deviations)


def test_joined_parts_have_the_inertia_of_their_points():
    """The inertia of parts from the theorem equals that of many points from the definition."""
    rng = np.random.default_rng(0)
    parts, points, masses = [], [], []
    for mass in (0.5, 2.0):
        local, shares = rng.normal(size=(40, 3)), np.full(40, mass / 40)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        place = rng.normal(size=3)
        parts.append((Pose(place, turn), _of_points(local, shares)))
        points.append(place + local @ turn.T)
        masses.append(shares)
    expected = _of_points(np.concatenate(points), np.concatenate(masses))
    whole = joined_inertia(parts)
    assert whole.mass_kg == pytest.approx(2.5)
    np.testing.assert_allclose(whole.centre, expected.centre, atol=1e-12)
    np.testing.assert_allclose(whole.matrix, expected.matrix, atol=1e-12)


def _of_points(points, masses):
    centre = masses @ points / masses.sum()
    away = points - centre
    matrix = sum(
        m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, away, strict=True)
    )
    return Inertia(masses.sum(), centre, matrix)


@pytest.mark.parametrize("shape", [shape for shape in Shape if shape is not Shape.POLYHEDRON])
def test_a_grown_primitive_reaches_further_by_as_much_everywhere(shape):
    part, grown = primitive(shape), primitive(shape).grown(0.05)
    along_axes = np.concatenate([TURN.T, -TURN.T])
    centre = np.asarray(part.offset)
    for way in along_axes:
        beyond = centre + 2.0 * way
        assert distances_to(part, beyond) - distances_to(grown, beyond) == pytest.approx(0.05)


def test_a_capsule_ends_where_it_was_asked_to():
    low, high = np.array([0.1, 0.2, 0.3]), np.array([-0.4, 0.1, 0.5])
    part = capsule_between(low, high, 0.05)
    np.testing.assert_allclose(part.cap_centres(), [low, high], atol=1e-15)
    np.testing.assert_allclose(distances_to(part, np.stack([low, high])), -0.05, atol=1e-15)


def test_the_corners_of_a_box_lie_on_its_surface_and_farthest_from_its_centre():
    part = primitive(Shape.BOX)
    corners = part.corners()
    assert len(np.unique(corners.round(9), axis=0)) == 8
    np.testing.assert_allclose(distances_to(part, corners), 0.0, atol=1e-15)
    away = np.linalg.norm(corners - np.asarray(part.offset), axis=1)
    np.testing.assert_allclose(away, np.linalg.norm(SIZES[Shape.BOX]))


def test_what_a_shape_does_not_have_is_refused():
    with pytest.raises(ValueError, match=naming("BOX", "radius")):
        _ = primitive(Shape.BOX).radius
    with pytest.raises(ValueError, match=naming("CAPSULE", "corners")):
        primitive(Shape.CAPSULE).corners()
