"""Convex polyhedra as data, with their exact mass properties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from veca_marl.sim.geometry.poses import Floats

MAX_TRIANGLES = 128
"""Drawing and touch examine every face; more than this belongs into several props."""


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
