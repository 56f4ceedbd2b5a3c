"""The world as eyes and skin meet it: objects made of primitives, and skins, on moving frames.

The owner of an object (the world for props, a body for its bones) writes the poses of its frames
into the scene's tables; `Scene.update` then carries every primitive and every mesh to its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from veca_marl.sim.meshes import Mesh, empty_meshes, with_mesh
from veca_marl.sim.pose import Floats
from veca_marl.sim.skinning import skin

Bools = NDArray[np.bool_]

MOST_SURFACES = int(np.iinfo(np.int16).max)  # a picture stores rows and ids in 16 bits


class Shape(IntEnum):
    """The primitives the eyes can draw."""

    SPHERE = 0
    BOX = 1
    CYLINDER = 2
    CAPSULE = 3


_SIZE_WORDS = {
    Shape.SPHERE: ("radius",),
    Shape.BOX: ("half x", "half y", "half z"),
    Shape.CYLINDER: ("radius", "length"),
    Shape.CAPSULE: ("radius", "length"),
}


@dataclass(frozen=True, eq=False)
class Geom:
    """One primitive on a frame.

    Attributes:
        shape: What it is.
        size: Metres. Sphere ``(radius,)``; box half extents ``(x, y, z)``; cylinder and capsule
            ``(radius, length)`` along the local z axis, where the length of a capsule is the
            distance between the centres of its caps, as in PyBullet.
        colour: ``(red, green, blue)`` in [0, 1].
        offset: ``(3,)`` metres from the frame's origin to the primitive's centre.
        rotation: ``(3, 3)`` from the primitive's axes to the frame's.
        checker_m: Edge of the checker pattern on its surface; 0 for a plain colour.
        transparent: Tints what lies behind it and hides nothing.
        visible: Whether eyes see it; bones under a skin only cast shadows.
        tangible: Whether it can be touched.
        skin_m: Thickness of the flexible skin that makes its outer layer; 0 for rigid things.

    Raises:
        ValueError: If a number is not possible.
    """

    shape: Shape
    size: tuple[float, ...]
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    offset: ArrayLike = (0.0, 0.0, 0.0)
    rotation: ArrayLike = field(default_factory=lambda: np.eye(3))
    checker_m: float = 0.0
    transparent: bool = False
    visible: bool = True
    tangible: bool = True
    skin_m: float = 0.0

    def __post_init__(self) -> None:
        words = _SIZE_WORDS[Shape(self.shape)]
        if len(self.size) != len(words) or not all(0.0 < s < np.inf for s in self.size):
            raise ValueError(
                f"{Shape(self.shape).name} size {self.size}: want positive {', '.join(words)}"
            )
        if len(self.colour) != 3 or not all(0.0 <= c <= 1.0 for c in self.colour):
            raise ValueError(f"colour {self.colour}: want three numbers in [0, 1]")
        offset, rotation = np.asarray(self.offset, float), np.asarray(self.rotation, float)
        if offset.shape != (3,) or not np.isfinite(offset).all():
            raise ValueError(f"offset {self.offset}: want three finite metres")
        if not _is_rotation(rotation):
            raise ValueError(f"rotation {self.rotation}: want an orthonormal right-handed matrix")
        if not 0.0 <= self.checker_m < np.inf:
            raise ValueError(f"checker_m {self.checker_m}: want 0 (plain) or an edge in metres")
        if not 0.0 <= self.skin_m < np.inf:
            raise ValueError(f"skin_m {self.skin_m}: want 0 (rigid) or a thickness in metres")


def _is_rotation(matrix: NDArray[np.float64]) -> bool:
    """Whether a matrix is 3x3, orthonormal and right-handed."""
    if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6):
        return False
    return bool(np.linalg.det(matrix) > 0.0)


class GeomTable(NamedTuple):
    """All primitives of a scene, one row each, as the renderer's loops read them.

    Attributes:
        shapes: ``(G,)`` int32 `Shape`.
        sizes: ``(G, 3)`` float32 metres, unused entries 0.
        colours: ``(G, 3)`` float32 in [0, 1].
        checkers: ``(G,)`` float32 metres.
        transparent: ``(G,)`` bool.
        visible: ``(G,)`` bool.
        tangible: ``(G,)`` bool.
        skins: ``(G,)`` metres.
        objects: ``(G,)`` int16 id of the object it belongs to.
        frames: ``(G,)`` int64 row in the frame table.
        offsets: ``(G, 3)`` metres, in the frame.
        turns: ``(G, 3, 3)`` from the primitive's axes to the frame's.
        positions: ``(G, 3)`` metres, world frame, as of the last `Scene.update`.
        rotations: ``(G, 3, 3)`` to the world, as of the last `Scene.update`.
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
    turns: Floats
    positions: Floats
    rotations: Floats


class SurfaceTable(NamedTuple):
    """Everything a pixel can show: first the rows of primitives, then those of triangles.

    Attributes:
        colours: ``(S, 3)`` float32; the rows of primitives are also `GeomTable.colours`.
        objects: ``(S,)`` int16 id of the object.
        frames: ``(S,)`` int64 row in the frame table.
    """

    colours: NDArray[np.float32]
    objects: NDArray[np.int16]
    frames: NDArray[np.int64]


class Scene:
    """Objects, the frames they hang on and the primitives they are made of.

    `positions` and `rotations` are the frame table. They are views that `add_object` replaces:
    look them up (or an object's slice of them) at each use and do not keep them over an addition.

    Attributes:
        objects: The objects in order of their ids.
        geoms: The table of primitives; replaced by `add_object`.
        meshes: The table of skins; likewise.
        surfaces: What pixels can show; likewise.
        version: Counts the changes, so that what was seen of an older state can be told.
    """

    def __init__(self) -> None:
        self.objects: list[SceneObject] = []
        self.geoms = _table([], 0, 0)
        self.meshes = empty_meshes()
        self.surfaces = SurfaceTable(self.geoms.colours, self.geoms.objects, self.geoms.frames)
        self.version = 0
        self._positions = np.zeros((0, 3))
        self._rotations = np.zeros((0, 3, 3))

    @property
    def positions(self) -> Floats:
        """``(F, 3)`` metres: where each frame is in the world. The owners write into it."""
        return self._positions

    @property
    def rotations(self) -> Floats:
        """``(F, 3, 3)``: each frame's axes to the world's. The owners write into it."""
        return self._rotations

    def add_object(
        self, name: str, frames: Sequence[Sequence[Geom]], mesh: Mesh | None = None
    ) -> SceneObject:
        """Add an object whose frames start at the world's origin.

        Args:
            name: Unique in the scene.
            frames: The primitives on each of its frames; a frame may be empty.
            mesh: A skin over those frames.

        Raises:
            ValueError: If the name is taken, there is no frame, or the scene is full.
        """
        if any(name == known.name for known in self.objects):
            raise ValueError(f"object {name!r} is already in the scene")
        if not frames:
            raise ValueError(f"object {name!r} has no frame")
        first_row, first_geom = len(self._positions), len(self.geoms.shapes)
        first_vertex, first_triangle = len(self.meshes.vertices), len(self.meshes.triangles)
        total = len(self.surfaces.objects) + sum(map(len, frames))
        total += 0 if mesh is None else len(mesh.triangles)
        if total > MOST_SURFACES:
            raise ValueError(
                f"{name!r} makes {total} primitives and triangles: a scene holds {MOST_SURFACES}"
            )
        self._add_surfaces(_table(frames, len(self.objects), first_row), mesh)
        self._positions = np.concatenate((self._positions, np.zeros((len(frames), 3))))
        self._rotations = np.concatenate((self._rotations, np.tile(np.eye(3), (len(frames), 1, 1))))
        item = SceneObject(
            id=len(self.objects),
            name=name,
            rows=slice(first_row, len(self._positions)),
            geoms=slice(first_geom, len(self.geoms.shapes)),
            vertices=slice(first_vertex, len(self.meshes.vertices)),
            triangles=slice(first_triangle, len(self.meshes.triangles)),
            scene=self,
        )
        self.objects.append(item)
        self.version += 1
        return item

    def _add_surfaces(self, added: GeomTable, mesh: Mesh | None) -> None:
        """Put primitives below the primitives and triangles below the triangles."""
        count, first_row = len(self.geoms.shapes), len(self._positions)
        self.geoms = _joined(self.geoms, added)
        old: tuple[NDArray[Any], ...] = self.surfaces
        new: tuple[NDArray[Any], ...] = (added.colours, added.objects, added.frames)
        skins: tuple[NDArray[Any], ...] = tuple(column[:0] for column in old)
        if mesh is not None:
            ids = np.full(len(mesh.owners), len(self.objects), np.int16)
            skins = (mesh.colours, ids, mesh.owners + first_row)
            self.meshes = with_mesh(self.meshes, mesh, first_row)
        columns: list[Any] = [
            np.concatenate((rows[:count], geoms, rows[count:], triangles))
            for rows, geoms, triangles in zip(old, new, skins, strict=True)
        ]
        self.surfaces = SurfaceTable(*columns)
        # one memory: who paints a primitive paints the surface
        self.geoms = self.geoms._replace(colours=self.surfaces.colours[: len(self.geoms.shapes)])

    def find(self, name: str) -> SceneObject:
        """Return the object called `name`.

        Raises:
            KeyError: If there is none; the message lists those that exist.
        """
        for item in self.objects:
            if item.name == name:
                return item
        raise KeyError(
            f"no object {name!r} in the scene; there are {[o.name for o in self.objects]}"
        )

    def update(self) -> None:
        """Carry everything to where its frames are now. The world calls it once per step."""
        g = self.geoms
        _compose(
            self._positions,
            self._rotations,
            g.frames,
            g.offsets,
            g.turns,
            g.positions,
            g.rotations,
        )
        if len(self.meshes.vertices):
            skin(self.meshes, self._positions, self._rotations)
        self.version += 1

    def hidden(self, object_id: int, frames: Sequence[int]) -> Bools:
        """Return a mask ``(S,)`` that is true for the surfaces on some frames of an object.

        Args:
            object_id: Which object.
            frames: Indices among the frames of that object.

        Raises:
            ValueError: If there is no such object or frame.
        """
        if not 0 <= object_id < len(self.objects):
            raise ValueError(f"object id {object_id}: the scene has 0..{len(self.objects) - 1}")
        rows = self.objects[object_id].rows
        count = rows.stop - rows.start
        if not all(0 <= frame < count for frame in frames):
            raise ValueError(f"frames {tuple(frames)}: object {object_id} has 0..{count - 1}")
        return np.isin(self.surfaces.frames, [rows.start + frame for frame in frames])


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One named thing in a scene.

    Attributes:
        id: Its value in segmentation images.
        name: Unique in the scene.
        rows: Its rows in the frame table.
        geoms: Its rows in the table of primitives.
        vertices: Its rows in the table of skins; none if it has no skin.
        triangles: Likewise.
        scene: The scene it is in.
    """

    id: int
    name: str
    rows: slice
    geoms: slice
    vertices: slice
    triangles: slice
    scene: Scene = field(repr=False)

    @property
    def positions(self) -> Floats:
        """``(frames, 3)`` metres: a view for the owner to write into; do not keep it."""
        return self.scene.positions[self.rows]

    @property
    def rotations(self) -> Floats:
        """``(frames, 3, 3)``: a view for the owner to write into; do not keep it."""
        return self.scene.rotations[self.rows]

    def paint(self, colour: tuple[float, float, float]) -> None:
        """Give all its primitives one colour ``(red, green, blue)`` in [0, 1]."""
        if len(colour) != 3 or not all(0.0 <= c <= 1.0 for c in colour):
            raise ValueError(f"colour {colour}: want three numbers in [0, 1]")
        self.scene.geoms.colours[self.geoms] = colour
        self.scene.version += 1


def _table(frames: Sequence[Sequence[Geom]], object_id: int, first_row: int) -> GeomTable:
    """Lay the primitives of one object out as rows."""
    geoms = [geom for frame in frames for geom in frame]
    rows = [first_row + row for row, frame in enumerate(frames) for _ in frame]
    n = len(geoms)
    sizes = np.zeros((n, 3), np.float32)
    for row, geom in enumerate(geoms):
        sizes[row, : len(geom.size)] = geom.size
    offsets = np.array([geom.offset for geom in geoms], np.float64).reshape(n, 3)
    turns = np.array([geom.rotation for geom in geoms], np.float64).reshape(n, 3, 3)
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
        turns=turns,
        positions=offsets.copy(),
        rotations=turns.copy(),
    )


def _joined(table: GeomTable, more: GeomTable) -> GeomTable:
    """Put the rows of one table below those of another."""
    above: tuple[NDArray[Any], ...] = table
    below: tuple[NDArray[Any], ...] = more
    columns: list[Any] = [np.concatenate(pair) for pair in zip(above, below, strict=True)]
    return GeomTable(*columns)


@njit(cache=True)
def _compose(
    frame_positions: Floats,
    frame_rotations: Floats,
    frames: NDArray[np.int64],
    offsets: Floats,
    turns: Floats,
    positions: Floats,
    rotations: Floats,
) -> None:
    """World pose of each primitive = pose of its frame x its place on the frame."""
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
                    total += frame_rotations[f, i, k] * turns[g, k, j]
                rotations[g, i, j] = total
