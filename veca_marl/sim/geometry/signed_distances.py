"""Signed distances to primitives and their gradients, in a primitive's own axes.

Negative inside. Inside and outside they are the exact Euclidean distances (spheres, capsules,
boxes, cylinders; for polyhedra see `solids`), with a gradient of length 1. The scalar functions
are inlined into the loops of touch and vision; they work in the precision of their arguments.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from numba import njit

from veca_marl.sim.geometry.primitives import Shape
from veca_marl.sim.geometry.vectors import Vector

DistanceAndGradient: TypeAlias = tuple[float, float, float, float]

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_TINY_M = 1e-12


@njit(cache=True, error_model="numpy", inline="always")
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


@njit(cache=True, error_model="numpy", inline="always")
def is_inside(shape: int, size: Vector, x: float, y: float, z: float) -> bool:
    """Return whether a point lies inside a primitive: much cheaper than its distance."""
    if shape == _BOX:
        return abs(x) < size[0] and abs(y) < size[1] and abs(z) < size[2]
    if shape == _CYLINDER:
        return abs(z) < 0.5 * size[1] and x * x + y * y < size[0] * size[0]
    if shape != _SPHERE:
        z = max(abs(z) - 0.5 * size[1], 0.0)
    return x * x + y * y + z * z < size[0] * size[0]


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy", inline="always")
def _from_sphere(radius: float, x: float, y: float, z: float) -> DistanceAndGradient:
    length = math.sqrt(x * x + y * y + z * z)
    scale = 1.0 / max(length, _TINY_M)
    return length - radius, x * scale, y * scale, z * scale


@njit(cache=True, error_model="numpy", inline="always")
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


@njit(cache=True, error_model="numpy", inline="always")
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
