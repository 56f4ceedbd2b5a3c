"""The solid that presses on a skin: a primitive, or a rigid bone with a layer of its own skin.

The skin of a bone is equally thick in all directions, so that the layer on a bone with edges is
round there: the points within its thickness of the bone. Spheres and capsules stay what they are,
with a greater radius.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from veca_marl.sim.geometry import (
    DistanceAndGradient,
    Shape,
    Solid,
    Vector,
    solid_distance,
    solid_entry,
    solid_gradient,
)
from veca_marl.sim.touch.rigid_bones import shrunk

_BOX, _CYLINDER = int(Shape.BOX), int(Shape.CYLINDER)
_SURFACE_M = 1e-7  # a ray that is so near has entered
_STEPS = 100  # of a ray; one that grazes the solid takes most


class PressingSolid(NamedTuple):
    """A solid and a layer around it, metres in the axes of the primitive.

    Attributes:
        core: The primitive without the layer, see `solid_of`.
        layer: Metres of skin around it; 0 where the skin is part of the core.
    """

    core: Solid
    layer: float


@njit(cache=True, error_model="numpy", inline="always")
def core_and_layer(shape: int, size: Vector, skin: float, kept: float) -> tuple[Vector, float]:
    """Return the size of the core of a primitive, and the layer of skin around it.

    Args:
        shape: A `Shape`.
        size: Its size with all of its skin.
        skin: Metres of skin.
        kept: Metres of them that belong to the pressing solid.
    """
    if shape in (_BOX, _CYLINDER):
        return shrunk(shape, size, skin), kept
    return shrunk(shape, size, skin - kept), 0.0


@njit(cache=True, error_model="numpy", inline="always")
def pressing_distance(pressing: PressingSolid, x: float, y: float, z: float) -> float:
    """Return the signed distance of a point, metres."""
    return solid_distance(pressing.core, x, y, z) - pressing.layer


@njit(cache=True, error_model="numpy", inline="always")
def pressing_gradient(pressing: PressingSolid, x: float, y: float, z: float) -> DistanceAndGradient:
    """Return the signed distance of a point and its gradient, see `distance_and_gradient`."""
    slope: DistanceAndGradient = solid_gradient(pressing.core, x, y, z)
    return slope[0] - pressing.layer, slope[1], slope[2], slope[3]


@njit(cache=True, error_model="numpy", inline="always")
def pressing_entry(pressing: PressingSolid, point: Vector, way: Vector, reach: float) -> float:
    """Return the distance along a ray from outside to where it enters.

    Args:
        pressing: The solid.
        point: Start of the ray.
        way: Its unit vector.
        reach: Metres.

    Returns:
        Metres; `reach` or more if it does not enter before.
    """
    if pressing.layer > 0.0:
        return _traced_entry(pressing, point, way, reach)
    return float(solid_entry(pressing.core, point, way))


@njit(cache=True, error_model="numpy")
def _traced_entry(pressing: PressingSolid, point: Vector, way: Vector, reach: float) -> float:
    """Follow a ray by its distance from the solid (sphere tracing; Hart, Visual Computer 1996)."""
    (x, y, z), (u, v, w) = point, way
    gone = 0.0
    for _ in range(_STEPS):
        away = pressing_distance(pressing, x + gone * u, y + gone * v, z + gone * w)
        if away <= _SURFACE_M:
            return gone
        gone += away
        if gone >= reach:
            break
    return reach
