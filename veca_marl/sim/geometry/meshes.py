"""Triangle meshes bound to the frames of objects, as data; `skinning` deforms them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.poses import Floats

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
