"""The primitives and surfaces of a scene: as a dataclass, and as arrays for compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.polyhedra import joined_rows, sizes_of
from veca_marl.sim.geometry.poses import Floats
from veca_marl.sim.geometry.primitives import Primitive
from veca_marl.sim.kernels import kernel

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Geom(Primitive):
    """A primitive of a scene: what eyes see and skins feel of it.

    Attributes:
        colour: ``(red, green, blue)`` in [0, 1].
        checker_m: Edge of the checker pattern on its surface; 0 for a plain colour.
        transparent: Whether it tints what lies behind it instead of hiding it.
        visible: Whether eyes see it. Invisible ones, such as bones under a skin, cast shadows.
        tangible: Whether it can be touched.
        skin_m: Thickness of the flexible skin that is its outer layer; 0 for rigid things.

    Raises:
        ValueError: If a number is out of its range; see also `Primitive`.
    """

    colour: tuple[float, float, float] = field(default=(0.7, 0.7, 0.7), kw_only=True)
    checker_m: float = field(default=0.0, kw_only=True)
    transparent: bool = field(default=False, kw_only=True)
    visible: bool = field(default=True, kw_only=True)
    tangible: bool = field(default=True, kw_only=True)
    skin_m: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        check_colour(self.colour)
        if not 0.0 <= self.checker_m < np.inf:
            raise ValueError(f"checker_m {self.checker_m}: must be 0 (plain) or an edge in metres")
        if not 0.0 <= self.skin_m < np.inf:
            raise ValueError(f"skin_m {self.skin_m}: must be 0 (rigid) or a thickness in metres")
        if self.hull is not None and self.skin_m > 0.0:
            raise ValueError(f"skin_m {self.skin_m}: a polyhedron has no skin")


def check_colour(colour: Sequence[float]) -> None:
    """Raise `ValueError` unless a colour is three numbers in [0, 1]."""
    if len(colour) != 3 or not all(0.0 <= c <= 1.0 for c in colour):
        raise ValueError(f"colour {colour}: must be three numbers in [0, 1]")


class GeomTable(NamedTuple):
    """All primitives of a scene, one row each, for compiled loops.

    Attributes:
        shapes: ``(G,)`` int32 `Shape`.
        sizes: ``(G, 3)`` float32 metres, unused entries 0; of a polyhedron see `sizes_of`.
        colours: ``(G, 3)`` float32 in [0, 1].
        checkers: ``(G,)`` float32 metres.
        transparent: ``(G,)`` bool.
        visible: ``(G,)`` bool.
        tangible: ``(G,)`` bool.
        skins: ``(G,)`` metres.
        objects: ``(G,)`` int16 id of the object it belongs to.
        frames: ``(G,)`` int64 row in the frame table.
        offsets: ``(G, 3)`` metres, in the frame.
        local_rotations: ``(G, 3, 3)`` from the primitive's axes to the frame's.
        positions: ``(G, 3)`` metres, world frame, as of the last `Scene.update`.
        rotations: ``(G, 3, 3)`` from the primitive's axes to the world's, likewise.
        faces: ``(N, FACE_COLUMNS)`` the triangles of all polyhedra, see `face_rows`.
    """

    shapes: NDArray[np.int32]
    sizes: NDArray[np.float32]
    colours: NDArray[np.float32]
    checkers: NDArray[np.float32]
    transparent: Bools
    visible: Bools
    tangible: Bools
    skins: Floats
    objects: NDArray[np.int16]
    frames: NDArray[np.int64]
    offsets: Floats
    local_rotations: Floats
    positions: Floats
    rotations: Floats
    faces: Floats


class SurfaceTable(NamedTuple):
    """Everything that a pixel can show: first all primitives, then all triangles.

    Attributes:
        colours: ``(S, 3)`` float32; those of primitives share memory with `GeomTable.colours`.
        objects: ``(S,)`` int16 id of the object.
        frames: ``(S,)`` int64 row in the frame table.
    """

    colours: NDArray[np.float32]
    objects: NDArray[np.int16]
    frames: NDArray[np.int64]


def geom_table(
    frames: Sequence[Sequence[Geom]], object_id: int, first_row: int, first_face: int
) -> GeomTable:
    """Return the primitives of one object as rows.

    Args:
        frames: The primitives on each of its frames.
        object_id: Id of the object.
        first_row: Row of its first frame in the scene's frame table.
        first_face: Number of triangles of polyhedra that the scene has already.
    """
    geoms = [geom for frame in frames for geom in frame]
    rows = [first_row + row for row, frame in enumerate(frames) for _ in frame]
    n = len(geoms)
    sizes = _sizes(geoms, first_face)
    offsets = np.array([geom.offset for geom in geoms], np.float64).reshape(n, 3)
    rotations = np.array([geom.rotation for geom in geoms], np.float64).reshape(n, 3, 3)
    return GeomTable(
        shapes=np.array([geom.shape for geom in geoms], np.int32),
        sizes=sizes,
        colours=np.array([geom.colour for geom in geoms], np.float32).reshape(n, 3),
        checkers=np.array([geom.checker_m for geom in geoms], np.float32),
        transparent=np.array([geom.transparent for geom in geoms], np.bool_),
        visible=np.array([geom.visible for geom in geoms], np.bool_),
        tangible=np.array([geom.tangible for geom in geoms], np.bool_),
        skins=np.array([geom.skin_m for geom in geoms], np.float64),
        objects=np.full(n, object_id, np.int16),
        frames=np.array(rows, np.int64),
        offsets=offsets,
        local_rotations=rotations,
        positions=offsets.copy(),
        rotations=rotations.copy(),
        faces=joined_rows([geom.hull for geom in geoms if geom.hull is not None]),
    )


def _sizes(geoms: Sequence[Geom], first_face: int) -> NDArray[np.float32]:
    """Return the sizes of primitives as rows ``(n, 3)``."""
    sizes = np.zeros((len(geoms), 3), np.float32)
    for row, geom in enumerate(geoms):
        sizes[row, : len(geom.size)] = geom.size
        if geom.hull is not None:
            sizes[row] = sizes_of(geom.hull, first_face)
            first_face += len(geom.hull.triangles)
    return sizes


def appended(table: GeomTable, more: GeomTable) -> GeomTable:
    """Return a table with the rows of another one below its own."""
    above: tuple[NDArray[Any], ...] = table
    below: tuple[NDArray[Any], ...] = more
    columns: list[Any] = [np.concatenate(pair) for pair in zip(above, below, strict=True)]
    return GeomTable(*columns)


@kernel
def compose(
    frame_positions: Floats,
    frame_rotations: Floats,
    frames: NDArray[np.int64],
    offsets: Floats,
    local_rotations: Floats,
    positions: Floats,
    rotations: Floats,
) -> None:
    """Write the world pose of each primitive: pose of its frame times its pose on the frame."""
    for g in range(frames.shape[0]):
        f = frames[g]
        for i in range(3):
            total = frame_positions[f, i]
            for k in range(3):
                total += frame_rotations[f, i, k] * offsets[g, k]
            positions[g, i] = total
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total += frame_rotations[f, i, k] * local_rotations[g, k, j]
                rotations[g, i, j] = total
