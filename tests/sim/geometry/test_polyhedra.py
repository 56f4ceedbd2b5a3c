"""Convex polyhedra: mass properties against integrals, distances and rays against references."""

import math

import numpy as np
import pytest
from refusals import naming
from scipy.spatial import cKDTree

from veca_marl.sim.geometry import (
    Geom,
    Primitive,
    Scene,
    Shape,
    convex_hull,
    distances_to,
    primitive_inertia,
    pyramid,
    sector_of_disc,
)
from veca_marl.sim.geometry.polyhedra import (
    MAX_TRIANGLES,
    face_rows,
    limited_distance,
    polyhedron_distance,
    polyhedron_entry,
    polyhedron_gradient,
    sizes_of,
)

HULLS = {
    "pyramid": pyramid(0.3, 0.4, 0.5),
    "sector": sector_of_disc(0.4, 0.1, 72.0),
    "half disc": sector_of_disc(0.3, 0.2, 180.0),
    "any": convex_hull(np.random.default_rng(0).uniform(-0.4, 0.4, (14, 3))),
}


def solid(hull):
    return Primitive(Shape.POLYHEDRON, (), hull=hull)


def test_a_box_as_a_polyhedron_has_the_mass_properties_and_distances_of_a_box():
    half = np.array([0.1, 0.2, 0.3])
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * half
    box, hull = Primitive(Shape.BOX, tuple(half)), solid(convex_hull(corners))
    assert hull.volume == pytest.approx(box.volume, rel=1e-12)
    expected, found = primitive_inertia(box, 2.0), primitive_inertia(hull, 2.0)
    np.testing.assert_allclose(found.matrix, expected.matrix, atol=1e-15)
    points = np.random.default_rng(1).uniform(-0.6, 0.6, (2000, 3))
    np.testing.assert_allclose(distances_to(hull, points), distances_to(box, points), atol=1e-12)


def test_a_pyramid_has_the_inertia_of_the_formula():
    """Base a x b, height h: I_z = m (a^2 + b^2) / 20, I_x = m (b^2 / 20 + 3 h^2 / 80)."""
    a, b, h = 0.3, 0.4, 0.5
    hull = pyramid(a, b, h)
    assert hull.volume == pytest.approx(a * b * h / 3.0, rel=1e-12)
    np.testing.assert_allclose(hull.centroid, (0.0, 0.0, -h / 4.0), atol=1e-15)
    x, y = b**2 / 20.0 + 3.0 * h**2 / 80.0, a**2 / 20.0 + 3.0 * h**2 / 80.0
    moments = 2.0 * np.array([x, y, (a**2 + b**2) / 20.0])
    np.testing.assert_allclose(hull.inertia(2.0), np.diag(moments), atol=1e-15)


def test_sectors_of_a_disc_have_its_volume_together():
    """The arc is made of edges: 0.8 % of the area are missing."""
    disc = math.pi * 0.4**2 * 0.1
    volumes = [sector_of_disc(0.4, 0.1, angle).volume for angle in (180.0, 90.0, 60.0, 30.0)]
    assert sum(volumes) == pytest.approx(disc, rel=0.01)
    assert volumes[0] / volumes[1] == pytest.approx(2.0, rel=0.005)


def points_on_edges(hull, count):
    """So many points on each side of each triangle, ``(N, 3)``, corners included."""
    ends = hull.corners[:, :, None, :], np.roll(hull.corners, 1, axis=1)[:, :, None, :]
    along = np.linspace(0.0, 1.0, count)[:, None]
    return (along * ends[0] + (1.0 - along) * ends[1]).reshape(-1, 3)


@pytest.mark.parametrize("name", HULLS)
def test_distances_are_exact_and_gradients_are_theirs(name):
    """References: nearest of many surface points outside; gradients by finite differences."""
    hull, rng = HULLS[name], np.random.default_rng(2)
    weights = rng.dirichlet(np.ones(3), (len(hull.triangles), 3000))
    surface = np.einsum("tnk,tkc->tnc", weights, hull.corners).reshape(-1, 3)
    surface = np.concatenate([surface, points_on_edges(hull, 200)])  # they are nearest to many
    points = rng.uniform(-0.8, 0.8, (300, 3))
    found = distances_to(solid(hull), points)
    height = (points @ hull.normals.T - hull.offsets).max(axis=1)
    np.testing.assert_array_equal(found < 0.0, height < 0.0)
    nearest = cKDTree(surface).query(points)[0]
    assert (np.abs(found) <= nearest + 1e-12).all()
    np.testing.assert_allclose(np.abs(found), nearest, atol=0.012)
    faces, size, step = face_rows(hull), sizes_of(hull, 0), 1e-6
    for point, distance in zip(points, found, strict=True):
        here, *slope = polyhedron_gradient(faces, size, *point)
        there = polyhedron_gradient(faces, size, *(point + step * np.array(slope)))[0]
        assert here == pytest.approx(distance, abs=1e-15)
        assert np.linalg.norm(slope) == pytest.approx(1.0, abs=1e-9)
        assert there - here == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("name", HULLS)
def test_limited_distances_are_the_same_numbers_up_to_the_limit(name):
    hull, rng, limit = HULLS[name], np.random.default_rng(4), 0.12
    faces, size = face_rows(hull), tuple(np.float32(sizes_of(hull, 0)))
    near = 0
    for point in rng.uniform(-0.7, 0.7, (2000, 3)):
        exact, found = (
            polyhedron_distance(faces, size, *point),
            limited_distance(faces, size, *point, limit),
        )
        assert found == exact if exact <= limit else found > limit
        near += exact <= limit
    assert 50 < near < 1500


@pytest.mark.parametrize("name", HULLS)
def test_rays_enter_at_the_surface_and_from_outside(name):
    hull, rng = HULLS[name], np.random.default_rng(3)
    faces, size = face_rows(hull), sizes_of(hull, 0)
    hits = 0
    for number in range(300):
        start = rng.normal(size=3)
        start *= 1.2 / np.linalg.norm(start)
        aims = rng.uniform(-0.3, 0.3, 3), rng.dirichlet(np.ones(len(hull.vertices))) @ hull.vertices
        way = aims[number % 2] - start  # the second one is inside
        way /= np.linalg.norm(way)
        entry = polyhedron_entry(faces, size, tuple(start), tuple(way))
        on_way = start + np.linspace(0.0, 2.4, 400)[:, None] * way
        inside = (on_way @ hull.normals.T < hull.offsets - 1e-3).all(axis=1)
        if inside.any():
            hits += 1
            assert entry <= 2.4 / 399 * np.argmax(inside)
        if number % 2 == 1:
            assert entry < np.linalg.norm(aims[1] - start)
        if entry < 10.0:
            assert distances_to(solid(hull), start + entry * way) == pytest.approx(0.0, abs=1e-12)
    assert hits > 50


def test_a_grown_polyhedron_has_all_faces_farther_out():
    hull = HULLS["any"]
    for by_m in (0.05, -0.01):
        grown = hull.grown(by_m)
        middles = hull.corners.mean(axis=1) + by_m * hull.normals
        np.testing.assert_allclose(
            (middles @ grown.normals.T - grown.offsets).max(axis=1), 0.0, atol=1e-9
        )
    with pytest.raises(ValueError, match=naming("by_m=-1.0")):
        hull.grown(-1.0)


@pytest.mark.parametrize(
    ("points", "named"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "four"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "plane"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, math.nan]], "nan"),
        (np.random.default_rng(0).normal(size=(400, 3)).tolist(), "triangles"),
    ],
)
def test_points_without_a_hull_are_refused(points, named):
    if named == "triangles":
        points = [np.divide(point, np.linalg.norm(point)) for point in points]
        named = f"{MAX_TRIANGLES}"
    with pytest.raises(ValueError, match=naming("points", named)):
        convex_hull(points)


def test_only_polyhedra_have_a_hull_and_none_has_a_skin():
    with pytest.raises(ValueError, match="SPHERE: hull"):
        Primitive(Shape.SPHERE, (0.1,), hull=HULLS["any"])
    with pytest.raises(ValueError, match="POLYHEDRON: hull=None"):
        Primitive(Shape.POLYHEDRON, ())
    with pytest.raises(ValueError, match="skin_m"):
        Geom(Shape.POLYHEDRON, (), hull=HULLS["any"], skin_m=0.001)


def test_a_scene_keeps_the_faces_of_all_its_polyhedra():
    scene = Scene()
    for name, hull in HULLS.items():
        scene.add_object(
            name, [[Geom(Shape.SPHERE, (0.1,)), Geom(Shape.POLYHEDRON, (), hull=hull)]]
        )
    assert len(scene.geoms.faces) == sum(len(hull.triangles) for hull in HULLS.values())
    for hull, size in zip(HULLS.values(), scene.geoms.sizes[1::2], strict=True):
        rows = scene.geoms.faces[int(size[0]) : int(size[0]) + int(size[1])]
        np.testing.assert_array_equal(rows, face_rows(hull))
