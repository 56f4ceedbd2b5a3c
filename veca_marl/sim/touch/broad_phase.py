"""Broad phase of touch: which bones of a body may be in contact with which primitives.

Bounding spheres of patches, bones and the whole body, recomputed for the present vertices, leave
out all pairs that are too far apart, so that a primitive far from the body costs next to nothing.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from veca_marl.sim.geometry import (
    Bools,
    Floats,
    GeomTable,
    Shape,
    Vector,
    bounding_radius,
    distance,
)
from veca_marl.sim.kernels import inlined, kernel
from veca_marl.sim.touch.taxels import TaxelTable

_POLYHEDRON = int(Shape.POLYHEDRON)

# shape, size, position and the three axes of a primitive in the world frame
PlacedPrimitive: TypeAlias = tuple[int, Vector, Vector, Vector, Vector, Vector]


@kernel
def bounding_spheres(taxels: TaxelTable, vertices: Floats, patches: Floats, bones: Floats) -> None:
    """Compute spheres that contain all sensing points, for any pose of the joints.

    Args:
        taxels: The taxels of the body.
        vertices: ``(V, 3)`` vertices of its skin, metres, world frame.
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
            away = squared_length(vertices[v, 0] - x, vertices[v, 1] - y, vertices[v, 2] - z)
            farthest = max(farthest, away)
        for t in range(taxels.patches[patch], taxels.patches[patch + 1]):
            margin = max(margin, taxels.margins[t])
        patches[patch, 0], patches[patch, 1], patches[patch, 2] = x, y, z
        patches[patch, 3] = math.sqrt(farthest) + margin
    whole = bones.shape[0] - 1
    for bone in range(whole):
        _enclose(patches, taxels.first_patch[bone], taxels.first_patch[bone + 1], bones, bone)
    _enclose(bones, 0, whole, bones, whole)


@kernel
def _enclose(spheres: Floats, first: int, end: int, out: Floats, row: int) -> None:
    """Write to a row a sphere that contains the spheres `first` to `end` - 1."""
    out[row] = 0.0
    for sphere in range(first, end):
        for axis in range(3):
            out[row, axis] += spheres[sphere, axis] / (end - first)
    radius = 0.0
    for sphere in range(first, end):
        x, y = spheres[sphere, 0] - out[row, 0], spheres[sphere, 1] - out[row, 1]
        z = spheres[sphere, 2] - out[row, 2]
        radius = max(radius, math.sqrt(squared_length(x, y, z)) + spheres[sphere, 3])
    out[row, 3] = radius


@kernel
def find_candidates(
    geoms: GeomTable,
    ignored: Bools,
    thickness: Floats,
    radii: Floats,
    bones: Floats,
    candidates: Bools,
) -> None:
    """Find the pairs of a bone and a primitive that may be in contact.

    Args:
        geoms: The scene's primitives.
        ignored: ``(B, G)`` pairs that are never in contact.
        thickness: ``(B,)`` metres, of the skin on each bone.
        radii: ``(B + 1,)`` metres, largest receptive field on each bone and, last, on the body.
        bones: ``(B + 1, 4)`` as from `bounding_spheres`.
        candidates: ``(B, G)``, written.
    """
    whole = bones.shape[0] - 1
    thickest = 0.0
    for bone in range(whole):
        thickest = max(thickest, thickness[bone])
    candidates[:] = False
    for g in range(candidates.shape[1]):
        size, skin = bounding_radius(geoms.shapes[g], geoms.sizes[g]), geoms.skins[g]
        reach = size + farthest_contact(thickest, skin, radii[whole])
        if not _spheres_overlap(bones, whole, geoms.positions, g, reach):
            continue
        primitive = placed_primitive(geoms, g)
        for bone in range(whole):
            if ignored[bone, g]:
                continue
            margin = farthest_contact(thickness[bone], skin, radii[bone])
            if _spheres_overlap(bones, bone, geoms.positions, g, size + margin):
                if primitive[0] == _POLYHEDRON:
                    candidates[bone, g] = True
                    continue
                x, y, z = to_local(primitive, bones, bone)
                away = distance(primitive[0], primitive[1], x, y, z)
                candidates[bone, g] = away < bones[bone, 3] + margin


@inlined
def farthest_contact(thickness: float, skin: float, radius: float) -> float:
    """Return the greatest distance of a sensed point of a primitive from the sensing point.

    The column of a taxel starts below the sensing point, at most twice the thickness of its own
    skin, and ends above it, at most the thickness of the primitive's skin.

    Args:
        thickness: Metres of skin on the bone.
        skin: Metres of skin on the primitive.
        radius: Metres, of the receptive field.
    """
    return max(thickness + min(thickness, skin), skin) + radius


@inlined
def _spheres_overlap(spheres: Floats, row: int, positions: Floats, g: int, reach: float) -> bool:
    """Return whether the bounding spheres of a bone and of a primitive overlap."""
    x, y = spheres[row, 0] - positions[g, 0], spheres[row, 1] - positions[g, 1]
    z, both = spheres[row, 2] - positions[g, 2], reach + spheres[row, 3]
    return bool(x * x + y * y + z * z < both * both)


@inlined
def placed_primitive(geoms: GeomTable, g: int) -> PlacedPrimitive:
    """Return one row of the table as scalars, loaded once for all points compared with it."""
    r, p, s = geoms.rotations, geoms.positions, geoms.sizes
    return (
        geoms.shapes[g],
        (float(s[g, 0]), float(s[g, 1]), float(s[g, 2])),
        (p[g, 0], p[g, 1], p[g, 2]),
        (r[g, 0, 0], r[g, 1, 0], r[g, 2, 0]),
        (r[g, 0, 1], r[g, 1, 1], r[g, 2, 1]),
        (r[g, 0, 2], r[g, 1, 2], r[g, 2, 2]),
    )


@inlined
def to_local(primitive: PlacedPrimitive, points: Floats, row: int) -> Vector:
    """Return a row of world points in the axes of a primitive."""
    _, _, origin, along_x, along_y, along_z = primitive
    x, y, z = points[row, 0] - origin[0], points[row, 1] - origin[1], points[row, 2] - origin[2]
    return (
        along_x[0] * x + along_x[1] * y + along_x[2] * z,
        along_y[0] * x + along_y[1] * y + along_y[2] * z,
        along_z[0] * x + along_z[1] * y + along_z[2] * z,
    )


@inlined
def squared_length(x: float, y: float, z: float) -> float:
    """Return the squared length of a vector."""
    return x * x + y * y + z * z
