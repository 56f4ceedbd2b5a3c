"""Touch from geometry alone: how deep things press into the flexible skin at each taxel.

A taxel reads ``T = min(1, d / d_max) max(0, -n . g)``: the depth d at which it lies in a thing, as
a share of the thickness d_max of its skin, times the component of the thing's outward direction g
against the normal n of its triangle (the paper, section on tactile perception). Where the bone
itself is met T reads 1. Of several things on one taxel the deepest counts. No force of the solver
enters, so that the reading does not depend on the time step.

A thing with a skin of its own, such as another body, is two springs in series: its outer surface
includes its skin, and d_max is the sum of both.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numba import njit

from veca_marl.sim.body.anatomy.skeleton import Skeleton
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.primitives import bounding_radius
from veca_marl.sim.geometry.signed_distances import (
    DistanceAndGradient,
    distance,
    distance_and_gradient,
    is_inside,
)
from veca_marl.sim.geometry.tables import Bools, GeomTable
from veca_marl.sim.geometry.vectors import Vector
from veca_marl.sim.touch.taxels import TaxelTable

# shape, size, position and the three axes of a primitive in the world
Thing: TypeAlias = tuple[int, Vector, Vector, Vector, Vector, Vector]


def neighbours(skeleton: Skeleton) -> Bools:
    """Return ``(47, 47)``: which bones do not feel each other, since joints keep them together.

    A bone, its parent, its children and the other children of its parent.
    """
    parents = skeleton.parents
    near = np.eye(len(parents), dtype=np.bool_) | (parents[:, None] == parents[None, :])
    child_of: Bools = parents[:, None] == np.arange(len(parents))[None, :]
    together: Bools = near | child_of | child_of.T
    return together


class Workspace(NamedTuple):
    """What a reading writes on its way; made once.

    Attributes:
        patches: ``(P, 4)`` centre and radius of a ball round each patch, as from `bound`.
        bones: ``(B + 1, 4)`` likewise round each bone and, last, the whole body.
        near: ``(B, G)`` which pairs to look at, as from `find_near`.
        local: ``(V, 3)`` vertices in the axes of a primitive.
    """

    patches: Floats
    bones: Floats
    near: Bools
    local: Floats


@njit(cache=True, error_model="numpy")
def feel(
    taxels: TaxelTable,
    vertices: Floats,
    geoms: GeomTable,
    deaf: Bools,
    barycentric: Floats,
    workspace: Workspace,
    readings: Floats,
) -> None:
    """Read all taxels: `bound`, `find_near` and `press` in one call.

    Args:
        taxels: The taxels of the body.
        vertices: ``(V, 3)`` the vertices of its skin, metres, world frame.
        geoms: The scene's primitives.
        deaf: ``(B, G)`` which bones do not feel which primitives.
        barycentric: ``(6, 3)`` where the taxels are on a triangle.
        workspace: Scratch.
        readings: ``(T, 6)`` in [0, 1], written.
    """
    patches, bones, near, local = workspace
    bound(taxels, vertices, patches, bones)
    find_near(geoms, deaf, bones, near)
    press(taxels, vertices, geoms, near, patches, barycentric, local, readings)


@njit(cache=True, error_model="numpy")
def press(
    taxels: TaxelTable,
    vertices: Floats,
    geoms: GeomTable,
    near: Bools,
    balls: Floats,
    barycentric: Floats,
    local: Floats,
    readings: Floats,
) -> None:
    """Read all taxels.

    All that is done for each triangle is handed numbers, no tables of arrays: with these it took
    four times as long, probably since numba counts who holds each array.

    Args:
        taxels: The taxels of the body.
        vertices: ``(V, 3)`` the vertices of its skin, metres, world frame.
        geoms: The scene's primitives.
        near: ``(B, G)`` which pairs to look at, as from `find_near`.
        balls: ``(P, 4)`` centre and radius of the ball round each patch, as from `bound`.
        barycentric: ``(6, 3)`` where the taxels are on a triangle.
        local: ``(V, 3)``, scratch.
        readings: ``(T, 6)`` in [0, 1], written.
    """
    readings[:] = 0.0
    triangles, depths, layers = taxels.triangles, taxels.depths, taxels.layers
    first_vertex, patches = taxels.first_vertex, taxels.patches
    for bone in range(near.shape[0]):
        for g in range(near.shape[1]):
            if not near[bone, g]:
                continue
            thing = _thing(geoms, g)
            thickness = taxels.thickness[bone] + geoms.skins[g]
            for patch in range(taxels.first_patch[bone], taxels.first_patch[bone + 1]):
                x, y, z = _local(thing, balls, patch)
                if distance(thing[0], thing[1], x, y, z) > balls[patch, 3]:
                    continue
                for i in range(first_vertex[patch], first_vertex[patch + 1]):
                    v = taxels.vertices[i]
                    local[v, 0], local[v, 1], local[v, 2] = _local(thing, vertices, v)
                for t in range(patches[patch], patches[patch + 1]):
                    a = _row(local, triangles[t, 0])
                    b = _row(local, triangles[t, 1])
                    c = _row(local, triangles[t, 2])
                    normal = _normal(a, b, c)
                    if _is_out_of_reach(thing, a, b, c, normal, layers[t, 0], layers[t, 1]):
                        continue
                    for n in range(barycentric.shape[0]):
                        share = _row(barycentric, n)
                        point = _taxel(a, b, c, share, normal, depths[t, n])
                        reading = _reading(thing, thickness, point, normal)
                        if reading > readings[t, n]:
                            readings[t, n] = reading


@njit(cache=True, error_model="numpy", inline="always")
def _thing(geoms: GeomTable, g: int) -> Thing:
    """One primitive, read once for all the points that are held against it."""
    r, p, s = geoms.rotations, geoms.positions, geoms.sizes
    return (
        geoms.shapes[g],
        (float(s[g, 0]), float(s[g, 1]), float(s[g, 2])),
        (p[g, 0], p[g, 1], p[g, 2]),
        (r[g, 0, 0], r[g, 1, 0], r[g, 2, 0]),
        (r[g, 0, 1], r[g, 1, 1], r[g, 2, 1]),
        (r[g, 0, 2], r[g, 1, 2], r[g, 2, 2]),
    )


@njit(cache=True, error_model="numpy", inline="always")
def _local(thing: Thing, points: Floats, row: int) -> Vector:
    """A point of the world in the axes of a primitive."""
    _, _, origin, along_x, along_y, along_z = thing
    x, y, z = points[row, 0] - origin[0], points[row, 1] - origin[1], points[row, 2] - origin[2]
    return (
        along_x[0] * x + along_x[1] * y + along_x[2] * z,
        along_y[0] * x + along_y[1] * y + along_y[2] * z,
        along_z[0] * x + along_z[1] * y + along_z[2] * z,
    )


@njit(cache=True, error_model="numpy", inline="always")
def _row(points: Floats, row: int) -> Vector:
    """Three numbers of a row."""
    return points[row, 0], points[row, 1], points[row, 2]


@njit(cache=True, error_model="numpy", inline="always")
def _is_out_of_reach(
    thing: Thing, a: Vector, b: Vector, c: Vector, normal: Vector, depth: float, spread: float
) -> bool:
    """Whether no taxel of a triangle can lie in a primitive.

    No taxel is farther from the middle than half of the farthest corner, see `BARYCENTRIC`.
    """
    x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    farthest = max(
        _squared_length(a[0] - x, a[1] - y, a[2] - z),
        _squared_length(b[0] - x, b[1] - y, b[2] - z),
        _squared_length(c[0] - x, c[1] - y, c[2] - z),
    )
    x, y, z = x - depth * normal[0], y - depth * normal[1], z - depth * normal[2]
    beyond = distance(thing[0], thing[1], x, y, z)
    return beyond > 0.0 and beyond * beyond > 0.25 * farthest + spread * spread


@njit(cache=True, error_model="numpy", inline="always")
def _taxel(a: Vector, b: Vector, c: Vector, share: Vector, normal: Vector, depth: float) -> Vector:
    """Where a taxel senses."""
    return (
        share[0] * a[0] + share[1] * b[0] + share[2] * c[0] - depth * normal[0],
        share[0] * a[1] + share[1] * b[1] + share[2] * c[1] - depth * normal[1],
        share[0] * a[2] + share[1] * b[2] + share[2] * c[2] - depth * normal[2],
    )


@njit(cache=True, error_model="numpy", inline="always")
def _reading(thing: Thing, thickness: float, point: Vector, normal: Vector) -> float:
    """What a taxel reads of a primitive; below 0 if it faces away."""
    if not is_inside(thing[0], thing[1], point[0], point[1], point[2]):
        return 0.0
    slope: DistanceAndGradient = distance_and_gradient(
        thing[0], thing[1], point[0], point[1], point[2]
    )
    depth = max(-slope[0], 0.0)
    against = -(slope[1] * normal[0] + slope[2] * normal[1] + slope[3] * normal[2])
    return min(depth / thickness, 1.0) * min(against, 1.0)


@njit(cache=True, error_model="numpy", inline="always")
def _squared_length(x: float, y: float, z: float) -> float:
    return x * x + y * y + z * z


@njit(cache=True, error_model="numpy", inline="always")
def _normal(a: Vector, b: Vector, c: Vector) -> Vector:
    """Unit vector at right angles to a triangle."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-18)
    return x * scale, y * scale, z * scale


@njit(cache=True, error_model="numpy")
def bound(taxels: TaxelTable, vertices: Floats, patches: Floats, bones: Floats) -> None:
    """Find balls that hold all points of sensing, however the joints are bent.

    Args:
        taxels: The taxels of the body.
        vertices: ``(V, 3)`` the vertices of its skin, metres, world frame.
        patches: ``(P, 4)``, written: centre and radius for each patch.
        bones: ``(B + 1, 4)``, written: likewise for each bone and, last, the whole body.
    """
    for patch in range(patches.shape[0]):
        first, end = taxels.first_vertex[patch], taxels.first_vertex[patch + 1]
        x = y = z = farthest = margin = 0.0
        for i in range(first, end):
            v = taxels.vertices[i]
            x, y, z = x + vertices[v, 0], y + vertices[v, 1], z + vertices[v, 2]
        x, y, z = x / (end - first), y / (end - first), z / (end - first)
        for i in range(first, end):
            v = taxels.vertices[i]
            away = _squared_length(vertices[v, 0] - x, vertices[v, 1] - y, vertices[v, 2] - z)
            farthest = max(farthest, away)
        for t in range(taxels.patches[patch], taxels.patches[patch + 1]):
            margin = max(margin, taxels.margins[t])
        patches[patch, 0], patches[patch, 1], patches[patch, 2] = x, y, z
        patches[patch, 3] = math.sqrt(farthest) + margin
    whole = bones.shape[0] - 1
    for bone in range(whole):
        _enclose(patches, taxels.first_patch[bone], taxels.first_patch[bone + 1], bones, bone)
    _enclose(bones, 0, whole, bones, whole)


@njit(cache=True, error_model="numpy")
def _enclose(balls: Floats, first: int, end: int, out: Floats, row: int) -> None:
    """Write a ball round some balls."""
    out[row] = 0.0
    for ball in range(first, end):
        for axis in range(3):
            out[row, axis] += balls[ball, axis] / (end - first)
    radius = 0.0
    for ball in range(first, end):
        x, y = balls[ball, 0] - out[row, 0], balls[ball, 1] - out[row, 1]
        z = balls[ball, 2] - out[row, 2]
        radius = max(radius, math.sqrt(_squared_length(x, y, z)) + balls[ball, 3])
    out[row, 3] = radius


@njit(cache=True, error_model="numpy")
def find_near(geoms: GeomTable, deaf: Bools, bones: Floats, near: Bools) -> None:
    """Find the pairs of a bone and a primitive that may touch: what is far costs next to nothing.

    Args:
        geoms: The scene's primitives.
        deaf: ``(B, G)`` which bones do not feel which primitives.
        bones: ``(B + 1, 4)`` as from `bound`.
        near: ``(B, G)``, written.
    """
    whole = bones.shape[0] - 1
    near[:] = False
    for g in range(near.shape[1]):
        reach = bounding_radius(geoms.shapes[g], geoms.sizes[g])
        if not _meet(bones, whole, geoms.positions, g, reach):
            continue
        thing = _thing(geoms, g)
        for bone in range(whole):
            if not deaf[bone, g] and _meet(bones, bone, geoms.positions, g, reach):
                x, y, z = _local(thing, bones, bone)
                near[bone, g] = distance(thing[0], thing[1], x, y, z) < bones[bone, 3]


@njit(cache=True, error_model="numpy", inline="always")
def _meet(balls: Floats, ball: int, positions: Floats, g: int, reach: float) -> bool:
    """Whether two balls overlap."""
    x, y = balls[ball, 0] - positions[g, 0], balls[ball, 1] - positions[g, 1]
    z, both = balls[ball, 2] - positions[g, 2], reach + balls[ball, 3]
    return bool(x * x + y * y + z * z < both * both)
