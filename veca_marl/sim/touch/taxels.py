"""The taxels: six tactile elements on each triangle of the skin, 9888 in all, sorted by bone.

The sensing point of a taxel is where the line through the taxel, along the normal of its triangle,
meets the physical skin: the surface at the distance d_max, the thickness of the skin, from the
rigid bone. The rendered mesh differs from that surface by up to 2 mm where it is bound; without the
shift, light contact on a hollow of the mesh would read 0, and contact on a bulge too much.
"""

from __future__ import annotations

import functools
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from veca_marl.sim.body.anatomy import (
    REFERENCE,
    Bone,
    Growth,
    Skeleton,
    binding_pose,
    load_skeleton,
    load_skin,
)
from veca_marl.sim.geometry import (
    Bools,
    Floats,
    Indices,
    Mesh,
    SceneObject,
    deform_meshes,
    distances_to,
    empty_meshes,
    with_mesh,
)

# "in triangle formation" (the paper, section on tactile perception): three near the corners, three
# near the middles of the edges, none on an edge, so that no two triangles share one
BARYCENTRIC = np.array(
    [
        (2 / 3, 1 / 6, 1 / 6),
        (1 / 6, 2 / 3, 1 / 6),
        (1 / 6, 1 / 6, 2 / 3),
        (5 / 12, 5 / 12, 1 / 6),
        (1 / 6, 5 / 12, 5 / 12),
        (5 / 12, 1 / 6, 5 / 12),
    ]
)
PATCH_TRIANGLES = 4
TAXELS_PER_TRIANGLE = len(BARYCENTRIC)
_ITERATIONS, _RELAXATION = 12, 0.7
# limits of the shift in metres, of the body of 0.78 m: over gaps between bones the mesh has no
# physical skin below it
_FARTHEST_OUT_M, _FARTHEST_IN_M = -0.004, 0.012


class TaxelTable(NamedTuple):
    """The places of the taxels on the skin, as arrays for compiled loops.

    Attributes:
        triangles: ``(T, 3)`` vertices, sorted by bone.
        first_triangle: ``(48,)`` triangles of bone b are first[b] to first[b + 1].
        depths: ``(T, 6)`` metres from the mesh, against the normal, to the sensing point.
        thickness: ``(47,)`` metres, d_max: thickness of the skin on each bone.
        first_patch: ``(48,)`` patches of bone b are first[b] to first[b + 1]. A patch is a few
            consecutive triangles that the broad phase treats as one.
        patches: ``(P + 1,)`` triangles of patch p are patches[p] to patches[p + 1].
        vertices: The vertices of the triangles of each patch, one patch after the other.
        first_vertex: ``(P + 1,)`` those of patch p are ``vertices[first[p] : first[p + 1]]``.
        gaps: ``(T,)`` metres in the binding pose: greatest distance of a corner of the
            triangle from the nearest of its taxels, which is a third of the longest median.
        margins: ``(T,)`` metres: greatest distance of a sensing point from its triangle.
        layers: ``(T, 2)`` metres: middle of the range of depths of a triangle, and half of it.
    """

    triangles: Indices
    first_triangle: Indices
    depths: Floats
    thickness: Floats
    first_patch: Indices
    patches: Indices
    vertices: Indices
    first_vertex: Indices
    gaps: Floats
    margins: Floats
    layers: Floats


def load_taxels(growth: Growth = REFERENCE) -> TaxelTable:
    """Return the taxels of a body of a size (made once per process; the result is read-only).

    Number and order of the taxels are the same for all sizes.
    """
    return _taxels(growth)


@functools.cache
def _taxels(growth: Growth) -> TaxelTable:
    skeleton, mesh = load_skeleton(growth), load_skin(growth)
    count = len(skeleton.bones)
    first_triangle = np.searchsorted(mesh.owners, np.arange(count + 1))
    starts = [np.arange(*ends, PATCH_TRIANGLES) for ends in pairwise(first_triangle)]
    patches = np.append(np.concatenate(starts), first_triangle[-1])
    own = [np.unique(mesh.triangles[first:end]) for first, end in pairwise(patches)]
    corners = _bound_corners(mesh, skeleton)
    depths = _depths(mesh, corners, skeleton)
    low, high = depths.min(axis=1), depths.max(axis=1)
    return TaxelTable(
        triangles=np.ascontiguousarray(mesh.triangles),
        first_triangle=first_triangle,
        depths=depths,
        thickness=np.array([bone.skin_thickness_m for bone in skeleton.bones]),
        first_patch=np.cumsum([0, *map(len, starts)]),
        patches=patches,
        vertices=np.concatenate(own),
        first_vertex=np.cumsum([0, *map(len, own)]),
        gaps=0.5
        * np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1),
        margins=np.abs(depths).max(axis=1),
        layers=np.stack([(high + low) / 2, (high - low) / 2], axis=1),
    )


def taxels_of(bone_name: str) -> slice:
    """Return the slice of the 9888 taxels that lie on a bone.

    Raises:
        KeyError: If there is no such bone; the message lists those that exist.
    """
    bone = load_skeleton().bone(bone_name)
    first = load_taxels().first_triangle
    return slice(TAXELS_PER_TRIANGLE * int(first[bone]), TAXELS_PER_TRIANGLE * int(first[bone + 1]))


def bound_triangles() -> tuple[Floats, Floats]:
    """Return centroids and normals ``(T, 3)`` of the triangles in the binding pose."""
    corners = _bound_corners(load_skin(), load_skeleton())
    centroids: Floats = corners.mean(axis=1)
    return centroids, _normals(corners)


def taxel_positions(taxels: TaxelTable, vertices: Floats) -> tuple[Floats, Floats]:
    """Return the positions of the taxels on the mesh and the normals of their triangles.

    Args:
        taxels: The table.
        vertices: ``(V, 3)`` metres.

    Returns:
        Positions ``(T, 6, 3)``, metres, and outward unit normals ``(T, 3)``.
    """
    corners = vertices[taxels.triangles]
    return _on_triangles(corners), _normals(corners)


def _on_triangles(corners: Floats) -> Floats:
    """Return the six points ``(T, 6, 3)`` on triangles ``(T, 3, 3)``."""
    points: Floats = np.einsum("bk,tkc->tbc", BARYCENTRIC, corners)
    return points


def _normals(corners: Floats) -> Floats:
    """Return the outward unit normals ``(T, 3)`` of triangles ``(T, 3, 3)``."""
    normals: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals


def _bound_corners(mesh: Mesh, skeleton: Skeleton) -> Floats:
    """Return the corners ``(T, 3, 3)`` of the triangles in the binding pose, metres."""
    bound = with_mesh(empty_meshes(), mesh, 0)
    deform_meshes(bound, *binding_pose(skeleton))
    corners: Floats = bound.vertices[mesh.triangles]
    return corners


def _depths(mesh: Mesh, corners: Floats, skeleton: Skeleton) -> Floats:
    """Return the depths ``(T, 6)`` of the physical skin below the mesh, in the binding pose."""
    positions, rotations = binding_pose(skeleton)
    points, normals = _on_triangles(corners), _normals(corners)
    depths = np.zeros(points.shape[:2])
    for index, bone in enumerate(skeleton.bones):
        own = mesh.owners == index
        local = (points[own] - positions[index]) @ rotations[index]
        inward = -(normals[own] @ rotations[index])[:, None]
        depths[own] = _march_to_skin(bone, local, inward, skeleton.growth.of(bone.name).girth)
    return depths


def _march_to_skin(bone: Bone, points: Floats, inward: Floats, girth: float) -> Floats:
    """Find how far points lie above the skin of a bone, by relaxed sphere tracing.

    Args:
        bone: The bone.
        points: ``(t, 6, 3)`` metres in its frame.
        inward: ``(t, 1, 3)`` unit direction of the search.
        girth: Of the bone, relative to the body of 0.78 m.

    Returns:
        ``(t, 6)`` metres, clipped where the search does not reach the skin.
    """
    depth: Floats = np.zeros(points.shape[:2])
    for _ in range(_ITERATIONS):
        height = distance_to_bone(bone, points + depth[..., None] * inward) - bone.skin_thickness_m
        depth = depth + _RELAXATION * height
    typical = 0.5 * float(np.median(distance_to_bone(bone, points)))
    return depth.clip(_FARTHEST_OUT_M * girth, typical + _FARTHEST_IN_M * girth)


def distance_to_bone(bone: Bone, points: Floats) -> Floats:
    """Return signed metres from ``(..., 3)`` points in a bone's frame to its rigid colliders."""
    nearest: Floats = np.min([distances_to(part, points) for part in bone.colliders], axis=0)
    return nearest


class Fields(NamedTuple):
    """The receptive fields of the taxels of a body.

    Attributes:
        radii: ``(1 + B, T)`` metres, of the taxels of each triangle: first for all primitives but
            those of the own body, then for each bone of the own body. Negative where a triangle
            does not sense that bone.
        largest: ``(B + 1,)`` metres, the largest on each bone and, last, on the body.
        body: Id of the own body among the objects of the scene.
        first_frame: Row of the first bone of the own body among the frames of the scene.
    """

    radii: Floats
    largest: Floats
    body: int
    first_frame: int


class Overlaps(NamedTuple):
    """Triangles that read their own body where no part of it is in contact with another.

    Attributes:
        triangles: ``(T,)`` those that read any bone with their receptive fields.
        joined: ``(B, T)`` those that read a bone even as points: the skins of both overlap.
    """

    triangles: Bools
    joined: Bools


def fields_of(
    taxels: TaxelTable, share: float, body: SceneObject, overlaps: Overlaps | None = None
) -> Fields:
    """Return receptive fields with radii of a share of the gaps between taxels.

    Args:
        taxels: The taxels.
        share: Of `TaxelTable.gaps`.
        body: The own body.
        overlaps: Triangles that sense the own body without a field, and pairs of a bone and a
            triangle that do not sense each other; None for none.
    """
    radii = np.tile(share * taxels.gaps, (1 + len(taxels.thickness), 1))
    if overlaps is not None:
        radii[1:, overlaps.triangles] = 0.0
        radii[1:][overlaps.joined] = -1.0
    largest = np.maximum.reduceat(radii[0], taxels.first_triangle[:-1])
    return Fields(radii, np.append(largest, radii.max()), body.id, body.rows.start)
