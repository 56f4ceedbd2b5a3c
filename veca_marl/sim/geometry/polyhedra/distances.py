"""Signed distances to convex polyhedra, their gradients, and where rays enter, in own axes.

`faces` is the table of all polyhedra of a scene and `size` the entry of one of them in the table
of primitives, see `table`. Inside, the distance is that to the nearest plane, which for a convex
solid is the exact Euclidean one. Outside, it is the least distance to the triangles that face the
point.
"""

from __future__ import annotations

import math

from numba import njit

from veca_marl.sim.geometry.polyhedra.table import PLANES_COLUMN
from veca_marl.sim.geometry.poses import Floats
from veca_marl.sim.geometry.vectors import Vector

NO_ENTRY_M = 1e9  # as in `ray_entry`
_PARALLEL = 1e-12
_TINY_M = 1e-9
_ROUNDING_M = 1e-6  # bounding radii are stored in single precision
_FAR_M = 1e9
_PLANES = int(PLANES_COLUMN)


@njit(cache=True, error_model="numpy")
def nearest_plane(faces: Floats, size: Vector, x: float, y: float, z: float) -> tuple[float, int]:
    """Return the greatest distance of a point above the planes of the faces, and its row."""
    first = int(size[0])
    highest, row = -_FAR_M, first
    for f in range(first, first + int(faces[first, _PLANES])):
        above = faces[f, 0] * x + faces[f, 1] * y + faces[f, 2] * z - faces[f, 3]
        if above > highest:
            highest, row = above, f
    return highest, row


@njit(cache=True, error_model="numpy")
def polyhedron_distance(faces: Floats, size: Vector, x: float, y: float, z: float) -> float:
    """Return the signed distance of a point, metres; negative inside."""
    highest, _ = nearest_plane(faces, size, x, y, z)
    if highest <= 0.0:
        return highest
    a, b, c = _nearest_point(faces, size, x, y, z)
    return math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)


@njit(cache=True, error_model="numpy")
def limited_distance(
    faces: Floats, size: Vector, x: float, y: float, z: float, limit_m: float
) -> float:
    """Return the signed distance of a point, or a number above a limit if it is above that limit.

    Far from the polyhedron this is much faster than `polyhedron_distance`: the distances to its
    bounding sphere and to its planes are lower bounds.
    """
    reach = size[2] + limit_m + _ROUNDING_M
    if x * x + y * y + z * z > reach * reach:
        return 2.0 * limit_m
    highest, _ = nearest_plane(faces, size, x, y, z)
    if highest <= 0.0 or highest > limit_m:
        return highest
    a, b, c = _nearest_point(faces, size, x, y, z)
    return math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)


@njit(cache=True, error_model="numpy")
def polyhedron_gradient(
    faces: Floats, size: Vector, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return the signed distance of a point and its gradient, a unit vector."""
    highest, row = nearest_plane(faces, size, x, y, z)
    if highest > 0.0:
        a, b, c = _nearest_point(faces, size, x, y, z)
        length = math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)
        if length > _TINY_M:
            return length, (x - a) / length, (y - b) / length, (z - c) / length
    return highest, faces[row, 0], faces[row, 1], faces[row, 2]


@njit(cache=True, error_model="numpy")
def polyhedron_entry(faces: Floats, size: Vector, point: Vector, direction: Vector) -> float:
    """Return the distance to where a ray enters from outside, see `entry_distance`."""
    (x, y, z), (u, v, w) = point, direction
    enter, leave = -_FAR_M, _FAR_M
    first = int(size[0])
    for f in range(first, first + int(faces[first, _PLANES])):
        above = faces[f, 0] * x + faces[f, 1] * y + faces[f, 2] * z - faces[f, 3]
        away = faces[f, 0] * u + faces[f, 1] * v + faces[f, 2] * w
        if away < -_PARALLEL:
            enter = max(enter, -above / away)
        elif away > _PARALLEL:
            leave = min(leave, -above / away)
        elif above > 0.0:
            return NO_ENTRY_M
    return enter if 0.0 <= enter <= leave else NO_ENTRY_M


@njit(cache=True, error_model="numpy")
def _nearest_point(faces: Floats, size: Vector, x: float, y: float, z: float) -> Vector:
    """Return the point of the surface nearest to a point outside."""
    first, best = int(size[0]), _FAR_M
    nearest = (x, y, z)
    for f in range(first, first + int(size[1])):
        above = faces[f, 0] * x + faces[f, 1] * y + faces[f, 2] * z - faces[f, 3]
        if above <= 0.0 or above * above >= best:
            continue
        a, b, c = nearest_on_triangle(faces, f, x, y, z)
        squared = (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2
        if squared < best:
            best, nearest = squared, (a, b, c)
    return nearest


@njit(cache=True, error_model="numpy")
def nearest_on_triangle(faces: Floats, f: int, x: float, y: float, z: float) -> Vector:
    """Return the point of a triangle that is nearest to a point.

    By the Voronoi regions of corners, edges and face (Ericson 2005, "Real-Time Collision
    Detection", section 5.1.5).
    """
    a = (faces[f, 4], faces[f, 5], faces[f, 6])
    b = (faces[f, 7], faces[f, 8], faces[f, 9])
    c = (faces[f, 10], faces[f, 11], faces[f, 12])
    p = (x, y, z)
    ab, ac = _minus(b, a), _minus(c, a)
    ap, bp, cp = _minus(p, a), _minus(p, b), _minus(p, c)
    d1, d2, d3, d4 = _dot(ab, ap), _dot(ac, ap), _dot(ab, bp), _dot(ac, bp)
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    if d3 >= 0.0 and d4 <= d3:
        return b
    if d6 >= 0.0 and d5 <= d6:
        return c
    over_a, over_b, over_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if over_c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return _along(a, ab, d1 / (d1 - d3))
    if over_b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return _along(a, ac, d2 / (d2 - d6))
    if over_a <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return _along(b, _minus(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6)))
    total = over_a + over_b + over_c
    return _along(_along(a, ab, over_b / total), ac, over_c / total)


@njit(cache=True, error_model="numpy", inline="always")
def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, error_model="numpy", inline="always")
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy", inline="always")
def _along(start: Vector, way: Vector, share: float) -> Vector:
    return start[0] + share * way[0], start[1] + share * way[1], start[2] + share * way[2]
