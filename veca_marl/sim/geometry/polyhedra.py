"""Convex polyhedra: as data, as rows for compiled loops, and their distances and ray entries.

`faces` is the table of all polyhedra of a scene and `size` the entry of one of them in the table
of primitives, see `sizes_of`. Inside, the distance is that to the nearest plane, which for a convex
solid is the exact Euclidean one. Outside, it is the least distance to the triangles that face the
point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from veca_marl.sim.geometry.poses import Floats, Vector
from veca_marl.sim.kernels import inlined, kernel

MAX_TRIANGLES = 128
"""Drawing and touch examine every face; more than this belongs into several props."""

ARC_STEP_DEG = 12.0
"""Greatest angle of one straight edge of an arc; the edge is 0.6 % of the radius inside the arc."""

FACE_COLUMNS = 14
"""Columns of a row, which are outward normal (3), offset of the plane, three corners (9), and, in
the first row of a polyhedron, the number of its planes."""

PLANES_COLUMN = 13

NO_ENTRY_M = 1e9  # as in `signed_distances`
_PARALLEL = 1e-12
_TINY_M = 1e-9
_ROUNDING_M = 1e-6  # bounding radii are stored in single precision
_FAR_M = 1e9
_PLANES = int(PLANES_COLUMN)


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A convex polyhedron; made by `convex_hull`.

    Attributes:
        vertices: ``(V, 3)`` metres, only corners of the hull.
        triangles: ``(T, 3)`` indices of vertices, counter-clockwise seen from outside. Faces with
            more than three corners are several triangles.
        normals: ``(T, 3)`` outward unit vectors.
        offsets: ``(T,)`` metres: ``normal . point`` of the plane of each triangle.
    """

    vertices: Floats
    triangles: NDArray[np.int64]
    normals: Floats
    offsets: Floats

    @property
    def corners(self) -> Floats:
        """``(T, 3, 3)`` metres: the corners of each triangle."""
        corners: Floats = self.vertices[self.triangles]
        return corners

    @property
    def radius(self) -> float:
        """Radius in metres of the sphere about the origin that contains it."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return float(self._six_volumes().sum() / 6.0)

    @property
    def centroid(self) -> Floats:
        """``(3,)`` metres: the centre of mass at constant density."""
        sixths = self._six_volumes()
        middles = self.corners.sum(axis=1) / 4.0  # the fourth corner is the origin
        centroid: Floats = sixths @ middles / sixths.sum()
        return centroid

    def second_moments(self) -> Floats:
        """Return the integral of ``x x^T`` over the volume, ``(3, 3)`` m^5, about the origin.

        The sum over the tetrahedra of origin and triangle, for each of which it is
        ``det / 120 (sum_i c_i c_i^T + s s^T)`` with the corners c and their sum s (Tonon 2004,
        "Explicit exact formulas for the 3-D tetrahedron inertia tensor").
        """
        corners, sums = self.corners, self.corners.sum(axis=1)
        squares = np.einsum("tki,tkj->tij", corners, corners)
        squares += np.einsum("ti,tj->tij", sums, sums)
        moments: Floats = np.einsum("t,tij->ij", self._six_volumes() / 120.0, squares)
        return moments

    def inertia(self, mass_kg: float) -> Floats:
        """Return the moment of inertia about the centroid, ``(3, 3)`` kg m^2."""
        centre = self.centroid
        spread = self.second_moments() / self.volume - np.outer(centre, centre)
        matrix: Floats = mass_kg * (np.trace(spread) * np.eye(3) - spread)
        return matrix

    def moved(self, by: ArrayLike) -> Polyhedron:
        """Return it translated by ``(3,)`` metres."""
        return convex_hull(self.vertices + np.asarray(by, np.float64))

    def grown(self, by_m: float) -> Polyhedron:
        """Return it with all faces moved outward, corners kept sharp.

        Raises:
            ValueError: If a negative distance leaves nothing.
        """
        planes = np.unique(np.round(np.c_[self.normals, -self.offsets], 12), axis=0)
        planes[:, 3] -= by_m
        inside = self.centroid
        if (planes[:, :3] @ inside + planes[:, 3]).max() >= 0.0:
            raise ValueError(f"by_m={by_m}: nothing is left of a polyhedron that thin")
        return convex_hull(HalfspaceIntersection(planes, inside).intersections)

    def _six_volumes(self) -> Floats:
        """Six times the signed volumes of the tetrahedra of origin and triangle, ``(T,)`` m^3."""
        six_volumes: Floats = np.linalg.det(self.corners)
        return six_volumes


def convex_hull(points: ArrayLike) -> Polyhedron:
    """Return the convex hull of points.

    Args:
        points: ``(N, 3)`` metres, at least four that are not in one plane.

    Raises:
        ValueError: If the points are not finite, have no volume, or their hull has more than
            `MAX_TRIANGLES` triangles.
    """
    array = np.asarray(points, np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) < 4 or not np.isfinite(array).all():
        raise ValueError(f"points {points!r}: must be four or more points of three finite metres")
    try:
        hull = ConvexHull(array)
    except QhullError:
        raise ValueError(f"points {points!r}: all in one plane, their hull has no volume") from None
    if len(hull.simplices) > MAX_TRIANGLES:
        raise ValueError(
            f"the hull of {len(array)} points has {len(hull.simplices)} triangles: "
            f"at most {MAX_TRIANGLES}"
        )
    kept, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles = triangles.reshape(hull.simplices.shape).astype(np.int64)
    vertices, normals = array[kept], hull.equations[:, :3].copy()
    clockwise = _facing(vertices[triangles], normals) < 0.0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return Polyhedron(vertices, triangles, normals, -hull.equations[:, 3])


def _facing(corners: Floats, normals: Floats) -> Floats:
    """Return how far the orientation of triangles ``(T, 3, 3)`` agrees with given normals."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    facing: Floats = (np.cross(b - a, c - a) * normals).sum(axis=1)
    return facing


def pyramid(length_x: float, length_y: float, height: float) -> Polyhedron:
    """Return a pyramid with its base below and its tip above the middle of the base, metres."""
    x, y, z = length_x / 2.0, length_y / 2.0, height / 2.0
    base = [(i * x, j * y, -z) for i in (-1.0, 1.0) for j in (-1.0, 1.0)]
    return convex_hull([*base, (0.0, 0.0, z)])


def sector_of_disc(radius: float, height: float, angle_deg: float) -> Polyhedron:
    """Return a sector of a disc: a fraction ``angle / 360`` of a flat cylinder about z.

    The tip of the sector is at the origin, its middle on the x axis, its faces at half of the
    height above and below. Sectors of different angles around one axis fill a disc.

    Args:
        radius: Metres.
        height: Metres.
        angle_deg: In (0, 180]; a wider sector is not convex.

    Raises:
        ValueError: If the angle is out of its range.
    """
    if not 0.0 < angle_deg <= 180.0:
        raise ValueError(f"angle_deg={angle_deg}: a sector has more than 0 and at most 180 degrees")
    edges = math.ceil(angle_deg / ARC_STEP_DEG)
    around = np.deg2rad(angle_deg) * np.linspace(-0.5, 0.5, edges + 1)
    arc = radius * np.stack([np.cos(around), np.sin(around)], axis=1)
    outline = np.vstack([np.zeros(2), arc])
    faces = [np.c_[outline, np.full(len(outline), side * height / 2.0)] for side in (-1.0, 1.0)]
    return convex_hull(np.vstack(faces))


def face_rows(polyhedron: Polyhedron) -> Floats:
    """Return the triangles of a polyhedron as rows ``(T, FACE_COLUMNS)``.

    The first rows have planes that are all different, so that loops over planes can leave the
    other triangles of the same faces out.
    """
    planes = np.column_stack([polyhedron.normals, polyhedron.offsets]).round(9)
    _, first = np.unique(planes, axis=0, return_index=True)
    others = np.setdiff1d(np.arange(len(planes)), first)
    order = np.concatenate([np.sort(first), others])
    rows = np.zeros((len(order), FACE_COLUMNS))
    rows[:, :3], rows[:, 3] = polyhedron.normals[order], polyhedron.offsets[order]
    rows[:, 4:13] = polyhedron.corners[order].reshape(-1, 9)
    rows[0, PLANES_COLUMN] = len(first)
    return rows


def sizes_of(polyhedron: Polyhedron, first_row: int) -> tuple[float, float, float]:
    """Return what the table of primitives stores in place of lengths.

    Returns:
        First row and number of rows in the table of faces, and the bounding radius in metres.
    """
    return float(first_row), float(len(polyhedron.triangles)), polyhedron.radius


def joined_rows(polyhedra: Sequence[Polyhedron]) -> Floats:
    """Return the rows of several polyhedra, one below the other."""
    return np.concatenate([np.zeros((0, FACE_COLUMNS)), *map(face_rows, polyhedra)])


@kernel
def nearest_plane(faces: Floats, size: Vector, x: float, y: float, z: float) -> tuple[float, int]:
    """Return the greatest distance of a point above the planes of the faces, and its row."""
    first = int(size[0])
    highest, row = -_FAR_M, first
    for f in range(first, first + int(faces[first, _PLANES])):
        above = faces[f, 0] * x + faces[f, 1] * y + faces[f, 2] * z - faces[f, 3]
        if above > highest:
            highest, row = above, f
    return highest, row


@kernel
def polyhedron_distance(faces: Floats, size: Vector, x: float, y: float, z: float) -> float:
    """Return the signed distance of a point, metres; negative inside."""
    highest, _ = nearest_plane(faces, size, x, y, z)
    if highest <= 0.0:
        return highest
    a, b, c = _nearest_point(faces, size, x, y, z)
    return math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)


@kernel
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


@kernel
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


@kernel
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


@kernel
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


@kernel
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


@inlined
def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _along(start: Vector, way: Vector, share: float) -> Vector:
    return start[0] + share * way[0], start[1] + share * way[1], start[2] + share * way[2]
