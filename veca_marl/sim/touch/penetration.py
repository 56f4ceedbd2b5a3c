"""The penetration model of touch: how deep primitives lie in the flexible skin at each taxel.

A taxel reads ``T = min(1, d / d_max) max(0, -n . g)``: the depth d of its sensing point in a
primitive, relative to the thickness d_max of its skin, times the component of the primitive's
outward distance gradient g against the normal n of its triangle (the paper, section on tactile
perception). T is 1 where the primitive reaches the bone. Of several primitives on one taxel the
largest reading counts. Only geometry enters and no force of the solver, so that the reading does
not depend on the time step.

A primitive with a skin of its own, such as a bone of another body, is treated as two springs in
series: its outer surface includes its skin, and d_max is the sum of both thicknesses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from veca_marl.sim.body.anatomy import Skeleton
from veca_marl.sim.geometry import (
    Bools,
    DistanceAndGradient,
    Floats,
    GeomTable,
    Vector,
    distance,
    distance_and_gradient,
    is_inside,
)
from veca_marl.sim.touch.broad_phase import (
    PlacedPrimitive,
    bounding_spheres,
    find_candidates,
    placed_primitive,
    squared_length,
    to_local,
)
from veca_marl.sim.touch.taxels import TaxelTable


def adjacent_bones(skeleton: Skeleton) -> Bools:
    """Return the ``(47, 47)`` symmetric mask of bones that joints keep in contact.

    These are a bone, its parent, its children and the other children of its parent. Contacts
    between them are not sensed.
    """
    parents = skeleton.parents
    near = np.eye(len(parents), dtype=np.bool_) | (parents[:, None] == parents[None, :])
    child_of: Bools = parents[:, None] == np.arange(len(parents))[None, :]
    adjacent: Bools = near | child_of | child_of.T
    return adjacent


class Workspace(NamedTuple):
    """Buffers of one body that each reading overwrites.

    Attributes:
        patches: ``(P, 4)`` bounding spheres of the patches, see `bounding_spheres`.
        bones: ``(B + 1, 4)`` likewise of the bones and, last, of the whole body.
        candidates: ``(B, G)`` pairs to examine, see `find_candidates`.
        local: ``(V, 3)`` vertices in the axes of a primitive.
    """

    patches: Floats
    bones: Floats
    candidates: Bools
    local: Floats


@njit(cache=True, error_model="numpy")
def read_taxels(
    taxels: TaxelTable,
    vertices: Floats,
    geoms: GeomTable,
    ignored: Bools,
    barycentric: Floats,
    workspace: Workspace,
    readings: Floats,
) -> None:
    """Compute the readings of all taxels: broad phase, then penetration.

    Args:
        taxels: The taxels of the body.
        vertices: ``(V, 3)`` vertices of its skin, metres, world frame.
        geoms: The scene's primitives.
        ignored: ``(B, G)`` pairs of bone and primitive that are not sensed.
        barycentric: ``(6, 3)`` places of the taxels on a triangle.
        workspace: Buffers.
        readings: ``(T, 6)`` in [0, 1], written.
    """
    patches, bones, candidates, local = workspace
    bounding_spheres(taxels, vertices, patches, bones)
    find_candidates(geoms, ignored, bones, candidates)
    measure_penetration(taxels, vertices, geoms, candidates, patches, barycentric, local, readings)


@njit(cache=True, error_model="numpy")
def measure_penetration(
    taxels: TaxelTable,
    vertices: Floats,
    geoms: GeomTable,
    candidates: Bools,
    spheres: Floats,
    barycentric: Floats,
    local: Floats,
    readings: Floats,
) -> None:
    """Compute the readings of all taxels from the candidate pairs.

    The functions called per triangle take scalars instead of tables of arrays: with tables the
    loop took four times as long, presumably because numba counts references to each array.

    Args:
        taxels: The taxels of the body.
        vertices: ``(V, 3)`` vertices of its skin, metres, world frame.
        geoms: The scene's primitives.
        candidates: ``(B, G)`` pairs to examine, see `find_candidates`.
        spheres: ``(P, 4)`` bounding spheres of the patches, see `bounding_spheres`.
        barycentric: ``(6, 3)`` places of the taxels on a triangle.
        local: ``(V, 3)`` buffer.
        readings: ``(T, 6)`` in [0, 1], written.
    """
    readings[:] = 0.0
    triangles, depths, layers = taxels.triangles, taxels.depths, taxels.layers
    first_vertex, patches = taxels.first_vertex, taxels.patches
    for bone in range(candidates.shape[0]):
        for g in range(candidates.shape[1]):
            if not candidates[bone, g]:
                continue
            primitive = placed_primitive(geoms, g)
            thickness = taxels.thickness[bone] + geoms.skins[g]
            for patch in range(taxels.first_patch[bone], taxels.first_patch[bone + 1]):
                x, y, z = to_local(primitive, spheres, patch)
                if distance(primitive[0], primitive[1], x, y, z) > spheres[patch, 3]:
                    continue
                for i in range(first_vertex[patch], first_vertex[patch + 1]):
                    v = taxels.vertices[i]
                    local[v, 0], local[v, 1], local[v, 2] = to_local(primitive, vertices, v)
                for t in range(patches[patch], patches[patch + 1]):
                    a = _row(local, triangles[t, 0])
                    b = _row(local, triangles[t, 1])
                    c = _row(local, triangles[t, 2])
                    normal = _unit_normal(a, b, c)
                    if _is_outside(primitive, a, b, c, normal, layers[t, 0], layers[t, 1]):
                        continue
                    for n in range(barycentric.shape[0]):
                        weights = _row(barycentric, n)
                        point = _sensing_point(a, b, c, weights, normal, depths[t, n])
                        reading = _reading(primitive, thickness, point, normal)
                        if reading > readings[t, n]:
                            readings[t, n] = reading


@njit(cache=True, error_model="numpy", inline="always")
def _row(points: Floats, row: int) -> Vector:
    """Return a row as three scalars."""
    return points[row, 0], points[row, 1], points[row, 2]


@njit(cache=True, error_model="numpy", inline="always")
def _is_outside(
    primitive: PlacedPrimitive,
    a: Vector,
    b: Vector,
    c: Vector,
    normal: Vector,
    depth: float,
    spread: float,
) -> bool:
    """Return whether all taxels of a triangle certainly lie outside a primitive.

    A bound: the distance of a taxel from the centroid is at most half of that of the farthest
    corner, see `BARYCENTRIC`.
    """
    x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    farthest = max(
        squared_length(a[0] - x, a[1] - y, a[2] - z),
        squared_length(b[0] - x, b[1] - y, b[2] - z),
        squared_length(c[0] - x, c[1] - y, c[2] - z),
    )
    x, y, z = x - depth * normal[0], y - depth * normal[1], z - depth * normal[2]
    beyond = distance(primitive[0], primitive[1], x, y, z)
    return beyond > 0.0 and beyond * beyond > 0.25 * farthest + spread * spread


@njit(cache=True, error_model="numpy", inline="always")
def _sensing_point(
    a: Vector, b: Vector, c: Vector, weights: Vector, normal: Vector, depth: float
) -> Vector:
    """Return the point of a taxel on the physical skin: `depth` below the mesh."""
    return (
        weights[0] * a[0] + weights[1] * b[0] + weights[2] * c[0] - depth * normal[0],
        weights[0] * a[1] + weights[1] * b[1] + weights[2] * c[1] - depth * normal[1],
        weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2] - depth * normal[2],
    )


@njit(cache=True, error_model="numpy", inline="always")
def _reading(primitive: PlacedPrimitive, thickness: float, point: Vector, normal: Vector) -> float:
    """Return the reading that one primitive causes; negative if the taxel faces away from it."""
    shape, size, x, y, z = primitive[0], primitive[1], point[0], point[1], point[2]
    if not is_inside(shape, size, x, y, z):
        return 0.0
    gradient: DistanceAndGradient = distance_and_gradient(shape, size, x, y, z)
    depth = max(-gradient[0], 0.0)
    against = -(gradient[1] * normal[0] + gradient[2] * normal[1] + gradient[3] * normal[2])
    return min(depth / thickness, 1.0) * min(against, 1.0)


@njit(cache=True, error_model="numpy", inline="always")
def _unit_normal(a: Vector, b: Vector, c: Vector) -> Vector:
    """Return the unit normal of a triangle, outward for counter-clockwise corners."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-18)
    return x * scale, y * scale, z * scale
