"""Where a single ray enters a primitive, in double precision and in the primitive's own axes.

The image kernels in `intersections` do the same for rows of rays in single precision. Quadrics are
solved without the small difference of large numbers ``b^2 - a c``, boxes by the slab test (Kay &
Kajiya, SIGGRAPH 1986).
"""

from __future__ import annotations

import math

from numba import njit

from veca_marl.sim.geometry.primitives import Shape
from veca_marl.sim.geometry.vectors import Vector

NO_ENTRY_M = 1e9  # returned for a ray that misses; larger than any scene
_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_PARALLEL = 1e-12


@njit(cache=True, error_model="numpy")
def entry_distance(shape: int, size: Vector, point: Vector, direction: Vector) -> float:
    """Return the distance from a point outside a primitive to where a ray enters it.

    Args:
        shape: A `Shape`.
        size: Metres, as in `Primitive`, filled up with zeros.
        point: Start of the ray, metres from the primitive's centre along its own axes.
        direction: Unit vector of the ray in the same axes.

    Returns:
        Metres, at least 0; `NO_ENTRY_M` if the ray misses the primitive.
    """
    (x, y, z), (u, v, w) = point, direction
    if shape == _SPHERE:
        return _sphere_entry(size[0], x, y, z, u, v, w)
    if shape == _BOX:
        near, far = _between_planes(size[0], x, u)
        near_y, far_y = _between_planes(size[1], y, v)
        near_z, far_z = _between_planes(size[2], z, w)
        return _first_common(max(near, near_y, near_z), min(far, far_y, far_z))
    near, far = _within_infinite_cylinder(size[0], x, y, u, v)
    half = 0.5 * size[1]
    if shape == _CYLINDER:
        near_z, far_z = _between_planes(half, z, w)
        return _first_common(max(near, near_z), min(far, far_z))
    side = _first_common(near, far)
    if abs(z + side * w) > half:
        side = NO_ENTRY_M
    low = _sphere_entry(size[0], x, y, z + half, u, v, w)
    return min(side, low, _sphere_entry(size[0], x, y, z - half, u, v, w))


@njit(cache=True, error_model="numpy", inline="always")
def _first_common(near: float, far: float) -> float:
    """Return the start of an interval of the ray if it is not empty and not behind."""
    return near if near <= far and near >= 0.0 else NO_ENTRY_M


@njit(cache=True, error_model="numpy", inline="always")
def _sphere_entry(
    radius: float, x: float, y: float, z: float, u: float, v: float, w: float
) -> float:
    along = x * u + y * v + z * w
    # squared distance of the line from the centre, by the cross product
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    inside = radius * radius - (cx * cx + cy * cy + cz * cz)
    if inside <= 0.0:
        return NO_ENTRY_M
    near = -along - math.sqrt(inside)
    return near if near >= 0.0 else NO_ENTRY_M


@njit(cache=True, error_model="numpy", inline="always")
def _between_planes(half: float, x: float, u: float) -> tuple[float, float]:
    """Return the interval of the ray between the planes ``x = -half`` and ``x = half``."""
    if abs(u) < _PARALLEL:
        return (-NO_ENTRY_M, NO_ENTRY_M) if abs(x) <= half else (NO_ENTRY_M, -NO_ENTRY_M)
    one, other = (-half - x) / u, (half - x) / u
    return min(one, other), max(one, other)


@njit(cache=True, error_model="numpy", inline="always")
def _within_infinite_cylinder(
    radius: float, x: float, y: float, u: float, v: float
) -> tuple[float, float]:
    """Return the interval of the ray within an infinite cylinder about the z axis."""
    a = u * u + v * v
    if a < _PARALLEL:
        inside = x * x + y * y <= radius * radius
        return (-NO_ENTRY_M, NO_ENTRY_M) if inside else (NO_ENTRY_M, -NO_ENTRY_M)
    cross = x * v - y * u
    q = a * radius * radius - cross * cross
    if q <= 0.0:
        return NO_ENTRY_M, -NO_ENTRY_M
    middle, width = -(x * u + y * v) / a, math.sqrt(q) / a
    return middle - width, middle + width
