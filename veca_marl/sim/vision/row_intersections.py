"""Intersections of the rays of one image row with one primitive, in the primitive's own axes.

The ray through pixel i is ``eye + t * (start + columns[i] * right)``. Every function updates the
depths and surfaces of the row where its primitive is hit from outside and nearer than before.
These loops take most of the rendering time; they are branch-free and in single precision.

Quadrics are solved with the discriminant ``a r^2 - (eye x ray)^2`` instead of ``b^2 - a c``. Both
are equal, but the second is a small difference of large numbers, and its rounding error exceeds
the size of a finger seen across a room. Boxes use the slab test (Kay & Kajiya, SIGGRAPH 1986).

Neither these functions nor `shading` and `contact_shadows` use `fastmath`: with it, a freshly
compiled kernel differs in the last bit from one loaded from the cache, and the same seed would not
give the same bytes. This costs about 5 % of the time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.polyhedra import PLANES_COLUMN
from veca_marl.sim.geometry.poses import Floats, Vector, single
from veca_marl.sim.kernels import kernel

Depths = NDArray[np.float32]
Surfaces = NDArray[np.int16]

# replaces a zero divisor: small enough that the slab is missed or spanned, without overflow
_TINY = single(1e-12)
_0 = single(0.0)
_1 = single(1.0)

_PLANES = int(PLANES_COLUMN)
_PARALLEL = 1e-12
_FAR_M = 1e9


@kernel
def sphere_row(
    radius: float,
    eye: Vector,
    start: Vector,
    right: Vector,
    columns: Depths,
    near: float,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect a row of rays with a sphere about the origin."""
    (ox, oy, oz), (sx, sy, sz), (rx, ry, rz) = eye, start, right
    a_0, b_0, b_1 = (
        sx * sx + sy * sy + sz * sz,
        ox * sx + oy * sy + oz * sz,
        ox * rx + oy * ry + oz * rz,
    )
    cx_0, cy_0, cz_0 = oy * sz - oz * sy, oz * sx - ox * sz, ox * sy - oy * sx
    cx_1, cy_1, cz_1 = oy * rz - oz * ry, oz * rx - ox * rz, ox * ry - oy * rx
    r_2 = radius * radius
    for i in range(columns.shape[0]):
        x = columns[i]
        a, b = a_0 + x * x, b_0 + x * b_1
        cx, cy, cz = cx_0 + x * cx_1, cy_0 + x * cy_1, cz_0 + x * cz_1
        q = a * r_2 - (cx * cx + cy * cy + cz * cz)
        t = (-b - math.sqrt(max(q, _0))) / a
        hit = (q > _0) & (t > near) & (t < depth[i])
        depth[i] = t if hit else depth[i]
        surfaces[i] = surface if hit else surfaces[i]


@kernel
def box_row(
    half: Vector,
    eye: Vector,
    start: Vector,
    right: Vector,
    columns: Depths,
    near: float,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect a row of rays with a box of half extents `half` about the origin."""
    (ox, oy, oz), (sx, sy, sz), (rx, ry, rz) = eye, start, right
    hx, hy, hz = half
    for i in range(columns.shape[0]):
        x = columns[i]
        dx, dy, dz = sx + x * rx, sy + x * ry, sz + x * rz
        ix = _1 / (dx if abs(dx) > _TINY else _TINY)
        iy = _1 / (dy if abs(dy) > _TINY else _TINY)
        iz = _1 / (dz if abs(dz) > _TINY else _TINY)
        mx, my, mz = -ox * ix, -oy * iy, -oz * iz
        wx, wy, wz = abs(ix) * hx, abs(iy) * hy, abs(iz) * hz
        t = max(mx - wx, max(my - wy, mz - wz))
        leave = min(mx + wx, min(my + wy, mz + wz))
        hit = (t < leave) & (t > near) & (t < depth[i])
        depth[i] = t if hit else depth[i]
        surfaces[i] = surface if hit else surfaces[i]


@kernel
def cylinder_row(
    radius: float,
    half_length: float,
    eye: Vector,
    start: Vector,
    right: Vector,
    columns: Depths,
    near: float,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect a row of rays with a cylinder about the z axis: an infinite cylinder and a slab."""
    (ox, oy, oz), (sx, sy, sz), (rx, ry, rz) = eye, start, right
    cross_0, cross_1 = ox * sy - oy * sx, ox * ry - oy * rx
    b_0, b_1 = ox * sx + oy * sy, ox * rx + oy * ry
    r_2 = radius * radius
    for i in range(columns.shape[0]):
        x = columns[i]
        dx, dy, dz = sx + x * rx, sy + x * ry, sz + x * rz
        a = max(dx * dx + dy * dy, _TINY)
        cross = cross_0 + x * cross_1
        q = a * r_2 - cross * cross
        inverse = _1 / a
        middle, width = -(b_0 + x * b_1) * inverse, math.sqrt(max(q, _0)) * inverse
        iz = _1 / (dz if abs(dz) > _TINY else _TINY)
        mz, wz = -oz * iz, abs(iz) * half_length
        t, leave = max(middle - width, mz - wz), min(middle + width, mz + wz)
        hit = (q > _0) & (t < leave) & (t > near) & (t < depth[i])
        depth[i] = t if hit else depth[i]
        surfaces[i] = surface if hit else surfaces[i]


@kernel
def capsule_row(
    radius: float,
    half_length: float,
    eye: Vector,
    start: Vector,
    right: Vector,
    columns: Depths,
    near: float,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect a row of rays with a capsule about the z axis.

    A ray enters the infinite cylinder between the caps or beyond one of them; in the second case
    only that cap can be hit first.
    """
    (ox, oy, oz), (sx, sy, sz), (rx, ry, rz) = eye, start, right
    cross_0, cross_1 = ox * sy - oy * sx, ox * ry - oy * rx
    b_0, b_1 = ox * sx + oy * sy, ox * rx + oy * ry
    r_2 = radius * radius
    for i in range(columns.shape[0]):
        x = columns[i]
        dx, dy, dz = sx + x * rx, sy + x * ry, sz + x * rz
        a, b = max(dx * dx + dy * dy, _TINY), b_0 + x * b_1
        cross = cross_0 + x * cross_1
        q = a * r_2 - cross * cross
        t_rod = (-b - math.sqrt(max(q, _0))) / a
        z = oz + t_rod * dz
        above = oz - (half_length if z > _0 else -half_length)
        cx, cy = oy * dz - above * dy, above * dx - ox * dz
        a_cap = a + dz * dz
        q_cap = a_cap * r_2 - (cx * cx + cy * cy + cross * cross)
        t_cap = (-(b + above * dz) - math.sqrt(max(q_cap, _0))) / a_cap
        beside = abs(z) <= half_length
        t = t_rod if beside else t_cap
        hit = (q > _0) & (beside | (q_cap > _0)) & (t > near) & (t < depth[i])
        depth[i] = t if hit else depth[i]
        surfaces[i] = surface if hit else surfaces[i]


@kernel
def write_heights(faces: Floats, first: int, eye: Vector, heights: Floats) -> int:
    """Write the distances of a point from the planes of a polyhedron, see `face_rows`.

    Returns:
        How many planes these are; the rest of `heights` is not written.
    """
    (ox, oy, oz), count = eye, int(faces[first, _PLANES])
    for k in range(count):
        f = first + k
        heights[k] = faces[f, 0] * ox + faces[f, 1] * oy + faces[f, 2] * oz - faces[f, 3]
    return count


@kernel
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
    the origin of the rays, see `write_heights`. A ray is done as soon as it leaves before it
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
