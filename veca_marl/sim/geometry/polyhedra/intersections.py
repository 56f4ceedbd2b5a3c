"""Intersections of the rays of one image row with a convex polyhedron, cf. `intersections`."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry.polyhedra.table import PLANES_COLUMN
from veca_marl.sim.geometry.poses import Floats
from veca_marl.sim.geometry.vectors import Vector

_PLANES = int(PLANES_COLUMN)
_PARALLEL = 1e-12
_FAR_M = 1e9


@njit(cache=True, error_model="numpy")
def heights_above(faces: Floats, first: int, eye: Vector) -> Floats:
    """Return the distances ``(P,)`` of a point from the planes of a polyhedron, see `face_rows`."""
    (ox, oy, oz), count = eye, int(faces[first, _PLANES])
    heights = np.empty(count)
    for k in range(count):
        f = first + k
        heights[k] = faces[f, 0] * ox + faces[f, 1] * oy + faces[f, 2] * oz - faces[f, 3]
    return heights


@njit(cache=True, error_model="numpy")
def polyhedron_row(
    faces: Floats,
    first: int,
    heights: Floats,
    start: Vector,
    right: Vector,
    columns: NDArray[np.float32],
    near: float,
    surface: np.int16,
    depth: NDArray[np.float32],
    surfaces: NDArray[np.int16],
) -> None:
    """Intersect a row of rays with the half spaces below the planes of all faces.

    The polyhedron is that with the row `first` in the table of faces, and `heights` are those of
    the origin of the rays, see `heights_above`. A ray is done as soon as it leaves before it
    enters, or enters behind what is drawn already.
    """
    (sx, sy, sz), (rx, ry, rz) = start, right
    for i in range(columns.shape[0]):
        x = columns[i]
        dx, dy, dz = sx + x * rx, sy + x * ry, sz + x * rz
        enter, leave = -_FAR_M, min(_FAR_M, depth[i])
        for k in range(heights.shape[0]):
            f, above = first + k, heights[k]
            away = faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz
            if away < -_PARALLEL:
                enter = max(enter, -above / away)
            elif away > _PARALLEL:
                leave = min(leave, -above / away)
            elif above > 0.0:
                leave = -_FAR_M
            if enter >= leave:
                break
        if near < enter < leave:
            depth[i] = enter
            surfaces[i] = surface
