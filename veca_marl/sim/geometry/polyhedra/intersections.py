"""Intersections of the rays of one image row with a convex polyhedron, cf. `intersections`."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry.polyhedra.table import PLANES_COLUMN
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.vectors import Vector

_PLANES = int(PLANES_COLUMN)
_PARALLEL = 1e-12
_FAR_M = 1e9


@njit(cache=True, error_model="numpy")
def polyhedron_row(
    faces: Floats,
    first: int,
    eye: Vector,
    start: Vector,
    right: Vector,
    columns: NDArray[np.float32],
    near: float,
    surface: np.int16,
    depth: NDArray[np.float32],
    surfaces: NDArray[np.int16],
) -> None:
    """Intersect a row of rays with the half spaces below the planes of all faces.

    The polyhedron is that with the row `first` in the table of faces.
    """
    (ox, oy, oz), (sx, sy, sz), (rx, ry, rz) = eye, start, right
    end = first + int(faces[first, _PLANES])
    for i in range(columns.shape[0]):
        x = columns[i]
        dx, dy, dz = sx + x * rx, sy + x * ry, sz + x * rz
        enter, leave = -_FAR_M, _FAR_M
        for f in range(first, end):
            above = faces[f, 0] * ox + faces[f, 1] * oy + faces[f, 2] * oz - faces[f, 3]
            away = faces[f, 0] * dx + faces[f, 1] * dy + faces[f, 2] * dz
            if away < -_PARALLEL:
                enter = max(enter, -above / away)
            elif away > _PARALLEL:
                leave = min(leave, -above / away)
            elif above > 0.0:
                leave = -_FAR_M
        if near < enter < leave and enter < depth[i]:
            depth[i] = enter
            surfaces[i] = surface
