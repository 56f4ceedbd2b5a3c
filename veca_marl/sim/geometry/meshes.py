"""Triangle meshes bound to the frames of objects, and linear blend skinning, which moves them.

Each vertex follows at most two frames: ``x = sum_k w_k (R_k o_k + t_k)``, where o_k is its position
in frame k in the binding pose (Magnenat-Thalmann, Laperriere & Thalmann 1988, "Joint-dependent
local deformations for hand animation and object grasping").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.poses import Floats
from veca_marl.sim.kernels import kernel

Indices = NDArray[np.int64]

INFLUENCES = 2


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh bound to the frames of one object.

    Attributes:
        frames: ``(V, 2)`` indices among the object's frames that each vertex follows.
        weights: ``(V, 2)`` weights of the two frames, summing to 1.
        offsets: ``(V, 2, 3)`` position of the vertex in either frame in the binding pose, metres.
        triangles: ``(T, 3)`` vertices, counter-clockwise seen from outside.
        owners: ``(T,)`` the frame that each triangle belongs to, so that a part can be hidden.
        colours: ``(T, 3)`` red, green, blue in [0, 1].

    Raises:
        ValueError: If the shapes of the arrays do not match, weights do not sum to 1 or a triangle
            has a vertex that does not exist.
    """

    frames: Indices
    weights: Floats
    offsets: Floats
    triangles: Indices
    owners: Indices
    colours: NDArray[np.float32]

    def __post_init__(self) -> None:
        vertices, triangles = len(self.frames), len(self.triangles)
        shapes = {
            "frames": (vertices, INFLUENCES),
            "weights": (vertices, INFLUENCES),
            "offsets": (vertices, INFLUENCES, 3),
            "triangles": (triangles, 3),
            "owners": (triangles,),
            "colours": (triangles, 3),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"mesh: {name} has shape {getattr(self, name).shape}, not {shape}")
        if not np.allclose(self.weights.sum(axis=1), 1.0):
            raise ValueError("mesh: the weights of each vertex must sum to 1")
        if triangles and not 0 <= self.triangles.min() <= self.triangles.max() < vertices:
            raise ValueError(f"mesh: triangles name vertices outside 0..{vertices - 1}")


class MeshTable(NamedTuple):
    """All meshes of a scene, one row per vertex or triangle, for compiled loops.

    Attributes:
        frames: ``(V, 2)`` rows in the scene's frame table.
        weights: ``(V, 2)``.
        offsets: ``(V, 2, 3)`` metres.
        triangles: ``(T, 3)`` rows of vertices.
        vertices: ``(V, 3)`` metres, world frame, as of the last `Scene.update`.
        normals: ``(V, 3)`` outward unit vectors, likewise.
        first_vertices: ``(M + 1,)`` first vertex of each mesh, and the number of vertices.
        first_triangles: ``(M + 1,)`` likewise.
        lower: ``(M, 3)`` metres, lower corner of each mesh's axis-aligned bounding box, as of the
            last `Scene.update`.
        upper: ``(M, 3)`` its upper corner.
    """

    frames: Indices
    weights: Floats
    offsets: Floats
    triangles: Indices
    vertices: Floats
    normals: Floats
    first_vertices: Indices
    first_triangles: Indices
    lower: Floats
    upper: Floats


def empty_meshes() -> MeshTable:
    """Return the table of a scene without meshes."""
    return MeshTable(
        np.zeros((0, INFLUENCES), np.int64),
        np.zeros((0, INFLUENCES)),
        np.zeros((0, INFLUENCES, 3)),
        np.zeros((0, 3), np.int64),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
    )


def with_mesh(table: MeshTable, mesh: Mesh, first_row: int) -> MeshTable:
    """Return the table with a mesh appended whose frames start at `first_row`."""
    count = len(mesh.frames)
    more = (
        mesh.frames + first_row,
        mesh.weights,
        mesh.offsets,
        mesh.triangles + len(table.vertices),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.array([len(table.vertices) + count]),
        np.array([len(table.triangles) + len(mesh.triangles)]),
        np.zeros((1, 3)),
        np.zeros((1, 3)),
    )
    columns: list[Any] = [np.concatenate(pair) for pair in zip(table, more, strict=True)]
    return MeshTable(*columns)


@kernel
def deform_meshes(meshes: MeshTable, positions: Floats, rotations: Floats) -> None:
    """Compute all vertices from their frames, then the normals and the bounding boxes.

    Args:
        meshes: `vertices`, `normals`, `lower` and `upper` are written.
        positions: ``(F, 3)`` the scene's frames, metres.
        rotations: ``(F, 3, 3)`` from their axes to the world's.
    """
    blend(meshes.frames, meshes.weights, meshes.offsets, positions, rotations, meshes.vertices)
    _write_normals(meshes.triangles, meshes.vertices, meshes.normals)
    _write_bounds(meshes)


@kernel
def blend(
    frames: Indices,
    weights: Floats,
    offsets: Floats,
    positions: Floats,
    rotations: Floats,
    vertices: Floats,
) -> None:
    """Write the vertices ``(V, 3)``; see `Mesh` for the other arguments."""
    for v in range(frames.shape[0]):
        x = y = z = 0.0
        for k in range(frames.shape[1]):
            weight = weights[v, k]
            if weight == 0.0:
                continue
            f = frames[v, k]
            turn = rotations[f]
            a, b, c = offsets[v, k, 0], offsets[v, k, 1], offsets[v, k, 2]
            x += weight * (turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c + positions[f, 0])
            y += weight * (turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c + positions[f, 1])
            z += weight * (turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c + positions[f, 2])
        vertices[v, 0], vertices[v, 1], vertices[v, 2] = x, y, z


@kernel
def _write_normals(triangles: Indices, vertices: Floats, normals: Floats) -> None:
    """Mean of the normals of the triangles at each vertex, weighted by their areas."""
    normals[:] = 0.0
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy, uz = vertices[b, 0], vertices[b, 1], vertices[b, 2]
        vx, vy, vz = vertices[c, 0], vertices[c, 1], vertices[c, 2]
        x0, y0, z0 = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        ux, uy, uz, vx, vy, vz = ux - x0, uy - y0, uz - z0, vx - x0, vy - y0, vz - z0
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for corner in (a, b, c):
            normals[corner, 0] += nx
            normals[corner, 1] += ny
            normals[corner, 2] += nz
    for v in range(normals.shape[0]):
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-12)
        normals[v, 0], normals[v, 1], normals[v, 2] = x * scale, y * scale, z * scale


@kernel
def _write_bounds(meshes: MeshTable) -> None:
    """Axis-aligned bounding box of each mesh."""
    for m in range(meshes.lower.shape[0]):
        meshes.lower[m] = math.inf
        meshes.upper[m] = -math.inf
        for v in range(meshes.first_vertices[m], meshes.first_vertices[m + 1]):
            for axis in range(3):
                meshes.lower[m, axis] = min(meshes.lower[m, axis], meshes.vertices[v, axis])
                meshes.upper[m, axis] = max(meshes.upper[m, axis], meshes.vertices[v, axis])
