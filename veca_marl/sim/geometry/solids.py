"""Distances and ray entries of primitives of any kind, polyhedra included.

The scalar functions of `signed_distances` and `ray_entry` know the primitives that three numbers
describe. A polyhedron needs the table of faces of its scene as well.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import njit, types
from numba.extending import overload

from veca_marl.sim.geometry.polyhedra.distances import (
    polyhedron_distance,
    polyhedron_entry,
    polyhedron_gradient,
)
from veca_marl.sim.geometry.polyhedra.table import face_rows, sizes_of
from veca_marl.sim.geometry.poses import Floats
from veca_marl.sim.geometry.primitives import Primitive
from veca_marl.sim.geometry.ray_entry import entry_distance
from veca_marl.sim.geometry.signed_distances import (
    DistanceAndGradient,
    distance,
    distance_and_gradient,
)
from veca_marl.sim.geometry.vectors import Vector

Solid: TypeAlias = tuple[int, Vector] | tuple[Floats, Vector]

_OPTIONS: Any = {"error_model": "numpy", "forceinline": True}


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


@njit(cache=True, error_model="numpy")
def _write_distances(solid: Solid, points: Floats, out: Floats) -> None:
    for i in range(points.shape[0]):
        out[i] = solid_distance(solid, points[i, 0], points[i, 1], points[i, 2])
