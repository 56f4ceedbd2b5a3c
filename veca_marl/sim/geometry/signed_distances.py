"""Signed distances to primitives, their gradients, and where rays enter, in own axes.

Negative inside. Inside and outside they are the exact Euclidean distances (spheres, capsules,
boxes, cylinders; for polyhedra see `polyhedra`), with a gradient of length 1. The scalar functions
are inlined into the loops of touch and vision; they work in the precision of their arguments.

Rays are intersected in double precision; the image kernels of `vision.row_intersections` do the
same for rows of rays in single precision. Quadrics are solved without the small difference of large
numbers ``b^2 - a c``, boxes by the slab test (Kay & Kajiya, SIGGRAPH 1986).

`distance`, `distance_and_gradient` and `entry_distance` know the primitives that three numbers
describe. A polyhedron needs the table of faces of its scene as well: the functions of a `Solid`
take any primitive.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numba import types
from numba.extending import overload

from veca_marl.sim.geometry.polyhedra import (
    face_rows,
    polyhedron_distance,
    polyhedron_entry,
    polyhedron_gradient,
    sizes_of,
)
from veca_marl.sim.geometry.poses import Floats, Vector
from veca_marl.sim.geometry.primitives import Primitive, Shape
from veca_marl.sim.kernels import inlined, kernel

DistanceAndGradient: TypeAlias = tuple[float, float, float, float]
Solid: TypeAlias = tuple[int, Vector] | tuple[Floats, Vector]

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_TINY_M = 1e-12
NO_ENTRY_M = 1e9  # returned for a ray that misses; larger than any scene
_PARALLEL = 1e-12
_OPTIONS: Any = {"error_model": "numpy", "forceinline": True}


@inlined
def distance(shape: int, size: Vector, x: float, y: float, z: float) -> float:
    """Return the signed distance alone, without its gradient; see `distance_and_gradient`.

    Where `shape` is a constant, the compiler leaves one branch over and vectorises the loop.
    """
    x, y, z = abs(x), abs(y), abs(z)
    if shape == _SPHERE:
        return math.sqrt(x * x + y * y + z * z) - float(size[0])
    if shape == _BOX:
        a, b, c = x - size[0], y - size[1], z - size[2]
        inside = min(max(a, b, c), 0.0)
        a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
        return math.sqrt(a * a + b * b + c * c) + inside
    if shape == _CYLINDER:
        side, end = math.sqrt(x * x + y * y) - size[0], z - 0.5 * size[1]
        inside = min(max(side, end), 0.0)
        side, end = max(side, 0.0), max(end, 0.0)
        return math.sqrt(side * side + end * end) + inside
    z = max(z - 0.5 * size[1], 0.0)
    return math.sqrt(x * x + y * y + z * z) - float(size[0])


@inlined
def is_inside(shape: int, size: Vector, x: float, y: float, z: float) -> bool:
    """Return whether a point lies inside a primitive: much cheaper than its distance."""
    if shape == _BOX:
        return abs(x) < size[0] and abs(y) < size[1] and abs(z) < size[2]
    if shape == _CYLINDER:
        return abs(z) < 0.5 * size[1] and x * x + y * y < size[0] * size[0]
    if shape != _SPHERE:
        z = max(abs(z) - 0.5 * size[1], 0.0)
    return x * x + y * y + z * z < size[0] * size[0]


@kernel
def distance_and_gradient(
    shape: int, size: Vector, x: float, y: float, z: float
) -> DistanceAndGradient:
    """Return the signed distance to a primitive and its gradient along x, y and z.

    Args:
        shape: A `Shape`.
        size: As in `Primitive`, filled up with zeros.
        x: Metres from the primitive's centre along its own axes; likewise `y`, `z`.
        y: See `x`.
        z: See `x`.
    """
    if shape == _SPHERE:
        return _from_sphere(size[0], x, y, z)
    if shape == _BOX:
        return _from_box(size, x, y, z)
    half = 0.5 * size[1]
    if shape == _CYLINDER:
        return _from_cylinder(size[0], half, x, y, z)
    return _from_sphere(size[0], x, y, z - min(max(z, -half), half))


@inlined
def _from_sphere(radius: float, x: float, y: float, z: float) -> DistanceAndGradient:
    length = math.sqrt(x * x + y * y + z * z)
    scale = 1.0 / max(length, _TINY_M)
    return length - radius, x * scale, y * scale, z * scale


@inlined
def _from_box(half: Vector, x: float, y: float, z: float) -> DistanceAndGradient:
    a, b, c = abs(x) - half[0], abs(y) - half[1], abs(z) - half[2]
    sx, sy, sz = math.copysign(1.0, x), math.copysign(1.0, y), math.copysign(1.0, z)
    if a <= 0.0 and b <= 0.0 and c <= 0.0:
        if a >= b and a >= c:
            return a, sx, 0.0, 0.0
        if b >= c:
            return b, 0.0, sy, 0.0
        return c, 0.0, 0.0, sz
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    length = math.sqrt(a * a + b * b + c * c)
    scale = 1.0 / max(length, _TINY_M)
    return length, sx * a * scale, sy * b * scale, sz * c * scale


@inlined
def _from_cylinder(radius: float, half: float, x: float, y: float, z: float) -> DistanceAndGradient:
    across = math.sqrt(x * x + y * y)
    scale, sz = 1.0 / max(across, _TINY_M), math.copysign(1.0, z)
    side, end = across - radius, abs(z) - half
    if side > 0.0 and end > 0.0:
        length = math.sqrt(side * side + end * end)
        out, up = side / length, end / length
        return length, out * x * scale, out * y * scale, up * sz
    if side > end:
        return side, x * scale, y * scale, 0.0
    return end, 0.0, 0.0, sz


@kernel
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


@inlined
def _first_common(near: float, far: float) -> float:
    """Return the start of an interval of the ray if it is not empty and not behind."""
    return near if near <= far and near >= 0.0 else NO_ENTRY_M


@inlined
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


@inlined
def _between_planes(half: float, x: float, u: float) -> tuple[float, float]:
    """Return the interval of the ray between the planes ``x = -half`` and ``x = half``."""
    if abs(u) < _PARALLEL:
        return (-NO_ENTRY_M, NO_ENTRY_M) if abs(x) <= half else (NO_ENTRY_M, -NO_ENTRY_M)
    one, other = (-half - x) / u, (half - x) / u
    return min(one, other), max(one, other)


@inlined
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


def distances_to(primitive: Primitive, points: Floats) -> Floats:
    """Return the signed distances ``(...)`` in metres of points ``(..., 3)`` of the same frame."""
    centre, rotation = primitive.pose
    local = np.ascontiguousarray(((points - centre) @ rotation).reshape(-1, 3))
    out = np.empty(len(local))
    size = (*primitive.size, 0.0, 0.0, 0.0)
    solid: Solid = int(primitive.shape), (size[0], size[1], size[2])
    if primitive.hull is not None:
        solid = face_rows(primitive.hull), sizes_of(primitive.hull, 0)
    _write_distances(solid, local, out)
    return out.reshape(points.shape[:-1])


def solid_of(faces: Floats | None, shape: int, size: Vector) -> Solid:
    """Return a primitive as the other functions take it: ``(shape, size)`` or ``(faces, size)``.

    Args:
        faces: The faces of all polyhedra, see `GeomTable`; None for all other shapes. Compiled
            loops are specialised by this type, so that other shapes carry no array.
        shape: A `Shape`.
        size: Its size, see `GeomTable`.
    """
    return (shape, size) if faces is None else (faces, size)


def solid_distance(solid: Solid, x: float, y: float, z: float) -> float:
    """Return the signed distance of a point, see `distance`."""
    if isinstance(solid[0], np.ndarray):
        return float(polyhedron_distance(solid[0], solid[1], x, y, z))
    return float(distance(solid[0], solid[1], x, y, z))


def solid_gradient(solid: Solid, x: float, y: float, z: float) -> DistanceAndGradient:
    """Return the signed distance of a point and its gradient, see `distance_and_gradient`."""
    if isinstance(solid[0], np.ndarray):
        polyhedral: DistanceAndGradient = polyhedron_gradient(solid[0], solid[1], x, y, z)
        return polyhedral
    simple: DistanceAndGradient = distance_and_gradient(solid[0], solid[1], x, y, z)
    return simple


def solid_entry(solid: Solid, point: Vector, way: Vector) -> float:
    """Return where a ray enters, see `entry_distance`."""
    if isinstance(solid[0], np.ndarray):
        return float(polyhedron_entry(solid[0], solid[1], point, way))
    return float(entry_distance(solid[0], solid[1], point, way))


# what compiled loops call in place of the functions above, by the type of their arguments; numba
# compares the signatures of the choice and of the chosen, so that neither can have annotations
overload(solid_of, jit_options=_OPTIONS)(
    lambda faces, shape, size: (
        (lambda faces, shape, size: (shape, size))
        if isinstance(faces, types.NoneType)
        else (lambda faces, shape, size: (faces, size))
    )
)
overload(solid_distance, jit_options=_OPTIONS)(
    lambda solid, x, y, z: (
        (lambda solid, x, y, z: polyhedron_distance(solid[0], solid[1], x, y, z))
        if isinstance(solid[0], types.Array)
        else (lambda solid, x, y, z: distance(solid[0], solid[1], x, y, z))
    )
)
overload(solid_gradient, jit_options=_OPTIONS)(
    lambda solid, x, y, z: (
        (lambda solid, x, y, z: polyhedron_gradient(solid[0], solid[1], x, y, z))
        if isinstance(solid[0], types.Array)
        else (lambda solid, x, y, z: distance_and_gradient(solid[0], solid[1], x, y, z))
    )
)
overload(solid_entry, jit_options=_OPTIONS)(
    lambda solid, point, way: (
        (lambda solid, point, way: polyhedron_entry(solid[0], solid[1], point, way))
        if isinstance(solid[0], types.Array)
        else (lambda solid, point, way: entry_distance(solid[0], solid[1], point, way))
    )
)


@kernel
def _write_distances(solid: Solid, points: Floats, out: Floats) -> None:
    for i in range(points.shape[0]):
        out[i] = solid_distance(solid, points[i, 0], points[i, 1], points[i, 2])
