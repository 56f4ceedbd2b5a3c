"""The penetration model of touch: how deep primitives are pressed into the skin at each taxel.

The skin at a taxel is a column of length t, the thickness d_max, from the base b on the rigid bone
along the normal n of the taxel's triangle to the sensing point b + t n. A primitive that enters
from outside displaces all skin outside of it. With e, the distance from b along n to where that
ray enters the primitive, and a, the angle between n and the primitive's surface normal there,

    C = min((1 - e / t) cos(a)^2, x_e).

For a plane at depth d below the sensing point C is ``d cos(a) / t``, the reading of the paper
(section on tactile perception): depth relative to d_max times the component of the primitive's
outward direction against n. Points of the primitive beside the column are sensed by the receptive
field of radius R. With m, the point of the primitive nearest to b (b itself if it is inside), q,
its distance from the column, and f, the angle between m - b and n,

    F = x (1 - (1 - x) sin(f)^2) (1 - (q / R)^2)^2   for q < R, else 0.

x, and likewise x_e at the entry of the ray, is the share of the skin that is displaced at m,
measured against the rigid bone: 1 - h / t with the height h of m above the bone, clipped to
[0, 1]. As not every triangle faces away from its bone, F is also computed with b moved onto the
bone once b is inside the primitive. The reading is ``T = max(C, F)``, and of several primitives the
largest counts. T does not decrease while a convex primitive approaches b, and is 1 where the
primitive reaches the bone at b. Only geometry enters and no force of the solver, so that the
reading does not depend on the time step.

A primitive with a skin of its own, such as a bone of another body, is treated as two springs in
series: t is the sum of both thicknesses, and heights count from rigid bone to rigid bone. With s,
the smaller of the two thicknesses, the primitive is its bone with a layer of s, which is round at
the edges of the bone, and b lies s inside the bone, so that b remains inside of thin bones. Other
bones of the own body are sensed in the same way, see `own_overlaps` for exceptions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import (
    Bools,
    Floats,
    GeomTable,
    Shape,
    Vector,
    solid_of,
)
from veca_marl.sim.kernels import inlined, kernel
from veca_marl.sim.touch.broad_phase import (
    PlacedPrimitive,
    bounding_spheres,
    farthest_contact,
    find_candidates,
    placed_primitive,
    squared_length,
    to_local,
)
from veca_marl.sim.touch.contact import (
    Column,
    PressingSolid,
    core_and_layer,
    pressing_distance,
    taxel_reading,
)
from veca_marl.sim.touch.rigid_bones import RigidBones, is_farther, place_bone
from veca_marl.sim.touch.taxels import BARYCENTRIC, Fields, TaxelTable

_POLYHEDRON = int(Shape.POLYHEDRON)


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


def empty_workspace(taxels: TaxelTable, vertices: int, primitives: int) -> Workspace:
    """Return buffers for a skin with a number of vertices in a scene of some primitives."""
    bones = len(taxels.thickness)
    return Workspace(
        patches=np.zeros((len(taxels.patches) - 1, 4)),
        bones=np.zeros((bones + 1, 4)),
        candidates=np.zeros((bones, primitives), np.bool_),
        local=np.zeros((vertices, 3)),
    )


def read_taxels(
    taxels: TaxelTable,
    fields: Fields,
    vertices: Floats,
    geoms: GeomTable,
    own: RigidBones,
    ignored: Bools,
    workspace: Workspace,
    readings: Floats,
) -> None:
    """Compute the readings of all taxels: broad phase, then penetration.

    Args:
        taxels: The taxels of the body.
        fields: Their receptive fields.
        vertices: ``(V, 3)`` vertices of its skin, metres, world frame.
        geoms: The scene's primitives.
        own: The rigid bones of the body among them.
        ignored: ``(B, G)`` pairs of bone and primitive that are not sensed.
        workspace: Buffers.
        readings: ``(T, 6)`` in [0, 1], written.
    """
    _read_all_but_polyhedra(taxels, fields, vertices, geoms, own, ignored, workspace, readings)
    if len(geoms.faces):
        measure_penetration(taxels, fields, vertices, geoms, geoms.faces, own, workspace, readings)


@kernel
def _read_all_but_polyhedra(
    taxels: TaxelTable,
    fields: Fields,
    vertices: Floats,
    geoms: GeomTable,
    own: RigidBones,
    ignored: Bools,
    workspace: Workspace,
    readings: Floats,
) -> None:
    """See `read_taxels`. The candidates include polyhedra."""
    bounding_spheres(taxels, vertices, workspace.patches, workspace.bones)
    find_candidates(
        geoms, ignored, taxels.thickness, fields.largest, workspace.bones, workspace.candidates
    )
    readings[:] = 0.0
    measure_penetration(taxels, fields, vertices, geoms, None, own, workspace, readings)


@kernel
def measure_penetration(
    taxels: TaxelTable,
    fields: Fields,
    vertices: Floats,
    geoms: GeomTable,
    faces: Floats | None,
    own: RigidBones,
    workspace: Workspace,
    readings: Floats,
) -> None:
    """Raise the readings of all taxels by the candidate pairs; see `read_taxels`.

    With `faces`, those of `geoms`, the pairs with polyhedra are examined; with None all others.
    The two are compiled apart, so that polyhedra cost nothing where there are none.
    """
    polyhedra = faces is not None
    candidates = workspace.candidates
    for bone in range(candidates.shape[0]):
        for g in range(candidates.shape[1]):
            if not candidates[bone, g] or (geoms.shapes[g] == _POLYHEDRON) != polyhedra:
                continue
            thickness, skin = taxels.thickness[bone], geoms.skins[g]
            inset = min(thickness, skin)
            primitive, layer = _sensed_primitive(geoms, g, inset)
            count = place_bone(geoms, own, bone, geoms.rotations[g], geoms.positions[g])
            # farther from the bone, no skin is displaced
            reach = thickness + skin - inset + layer
            if not polyhedra and is_farther(primitive[0], primitive[1], own.placed, count, reach):
                continue
            solid = PressingSolid(solid_of(faces, primitive[0], primitive[1]), layer)
            column = Column(solid, thickness + skin, thickness + inset, inset, count)
            margin = farthest_contact(thickness, skin, fields.largest[bone])
            own_bone = geoms.objects[g] == fields.body
            radii = fields.radii[1 + geoms.frames[g] - fields.first_frame if own_bone else 0]
            for patch in range(taxels.first_patch[bone], taxels.first_patch[bone + 1]):
                x, y, z = to_local(primitive, workspace.patches, patch)
                away = pressing_distance(solid, x, y, z)
                if away > workspace.patches[patch, 3] + margin:
                    continue
                _read_patch(
                    taxels,
                    patch,
                    radii,
                    vertices,
                    primitive,
                    column,
                    own.placed,
                    workspace.local,
                    readings,
                )


@kernel
def _sensed_primitive(geoms: GeomTable, g: int, kept: float) -> tuple[PlacedPrimitive, float]:
    """Return a row of the table as scalars, its core alone, and the layer of `PressingSolid`.

    Args:
        geoms: The scene's primitives.
        g: The row.
        kept: Metres of its own skin that belong to the solid.
    """
    shape, size, origin, along_x, along_y, along_z = placed_primitive(geoms, g)
    core, layer = core_and_layer(shape, size, geoms.skins[g], kept)
    return (shape, core, origin, along_x, along_y, along_z), layer


@inlined
def _read_patch(
    taxels: TaxelTable,
    patch: int,
    radii: Floats,
    vertices: Floats,
    primitive: PlacedPrimitive,
    column: Column,
    placed: Floats,
    local: Floats,
    readings: Floats,
) -> None:
    """Update the readings of one patch by one primitive.

    The functions called per triangle take scalars instead of tables of arrays: with tables the
    loop took four times as long, presumably because numba counts references to each array.
    """
    triangles, depths, layers = taxels.triangles, taxels.depths, taxels.layers
    for i in range(taxels.first_vertex[patch], taxels.first_vertex[patch + 1]):
        v = taxels.vertices[i]
        local[v, 0], local[v, 1], local[v, 2] = to_local(primitive, vertices, v)
    for t in range(taxels.patches[patch], taxels.patches[patch + 1]):
        a = _row(local, triangles[t, 0])
        b = _row(local, triangles[t, 1])
        c = _row(local, triangles[t, 2])
        normal = _unit_normal(a, b, c)
        if radii[t] < 0.0 or _is_outside(
            column, a, b, c, normal, layers[t, 0], layers[t, 1], radii[t]
        ):
            continue
        for n in range(BARYCENTRIC.shape[0]):
            base = _base(a, b, c, _row(BARYCENTRIC, n), normal, depths[t, n] + column.depth)
            readings[t, n] = taxel_reading(column, placed, base, normal, radii[t], readings[t, n])


@inlined
def _row(points: Floats, row: int) -> Vector:
    """Return a row as three scalars."""
    return points[row, 0], points[row, 1], points[row, 2]


@inlined
def _is_outside(
    column: Column,
    a: Vector,
    b: Vector,
    c: Vector,
    normal: Vector,
    middle: float,
    spread: float,
    radius: float,
) -> bool:
    """Return whether a primitive certainly lies outside the columns and fields of a triangle.

    A bound: the distance of a taxel from the centroid is at most half of that of the farthest
    corner, see `BARYCENTRIC`. `middle` and `spread` are the range of the depths of the triangle.
    """
    x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    farthest = max(
        squared_length(a[0] - x, a[1] - y, a[2] - z),
        squared_length(b[0] - x, b[1] - y, b[2] - z),
        squared_length(c[0] - x, c[1] - y, c[2] - z),
    )
    depth = middle + column.depth - 0.5 * column.length
    x, y, z = x - depth * normal[0], y - depth * normal[1], z - depth * normal[2]
    beyond = pressing_distance(column.solid, x, y, z)
    along = spread + 0.5 * column.length
    return beyond > math.sqrt(0.25 * farthest + along * along) + radius


@inlined
def _base(a: Vector, b: Vector, c: Vector, weights: Vector, normal: Vector, depth: float) -> Vector:
    """Return the point `depth` below a taxel on the mesh."""
    return (
        weights[0] * a[0] + weights[1] * b[0] + weights[2] * c[0] - depth * normal[0],
        weights[0] * a[1] + weights[1] * b[1] + weights[2] * c[1] - depth * normal[1],
        weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2] - depth * normal[2],
    )


@inlined
def _unit_normal(a: Vector, b: Vector, c: Vector) -> Vector:
    """Return the unit normal of a triangle, outward for counter-clockwise corners."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-18)
    return x * scale, y * scale, z * scale
