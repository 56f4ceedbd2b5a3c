"""The scene that vision and touch read: objects of primitives and meshes on moving frames.

The owner of an object (the world for props, a body for its bones) writes the poses of its frames
into the scene's tables; `Scene.update` then computes the poses of all primitives and meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.meshes import Mesh, deform_meshes, empty_meshes, with_mesh
from veca_marl.sim.geometry.poses import Floats
from veca_marl.sim.geometry.tables import (
    Bools,
    Geom,
    GeomTable,
    SurfaceTable,
    appended,
    check_colour,
    compose,
    geom_table,
)

MAX_SURFACES = int(np.iinfo(np.int16).max)  # images store rows and ids in 16 bits


class Scene:
    """Objects, their frames, and the primitives and meshes on these.

    `positions` and `rotations` are the frame table. `add_object` replaces them: look them up (or
    an object's slice of them) at each use.

    Attributes:
        objects: The objects in order of their ids.
        geoms: The table of primitives; replaced by `add_object`.
        meshes: The table of meshes; likewise.
        surfaces: What pixels can show; likewise.
        version: Counts the changes: what was computed from an older version is outdated.
    """

    def __init__(self) -> None:
        self.objects: list[SceneObject] = []
        self.geoms = geom_table([], 0, 0, 0)
        self.meshes = empty_meshes()
        self.surfaces = SurfaceTable(self.geoms.colours, self.geoms.objects, self.geoms.frames)
        self.version = 0
        self._positions = np.zeros((0, 3))
        self._rotations = np.zeros((0, 3, 3))

    @property
    def positions(self) -> Floats:
        """``(F, 3)`` metres: positions of the frames in the world, written by their owners."""
        return self._positions

    @property
    def rotations(self) -> Floats:
        """``(F, 3, 3)``: rotations of the frames to the world, written by their owners."""
        return self._rotations

    def add_object(
        self, name: str, frames: Sequence[Sequence[Geom]], mesh: Mesh | None = None
    ) -> SceneObject:
        """Add an object with its frames at the world's origin.

        Args:
            name: Unique in the scene.
            frames: The primitives on each of its frames; a frame may be empty.
            mesh: A mesh bound to those frames.

        Raises:
            ValueError: If the name is taken, there is no frame, or the scene is full.
        """
        self._check_addition(name, frames, mesh)
        first_row, first_geom = len(self._positions), len(self.geoms.shapes)
        first_vertex, first_triangle = len(self.meshes.vertices), len(self.meshes.triangles)
        first_face = len(self.geoms.faces)
        self._add_surfaces(geom_table(frames, len(self.objects), first_row, first_face), mesh)
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

    def _check_addition(
        self, name: str, frames: Sequence[Sequence[Geom]], mesh: Mesh | None
    ) -> None:
        if any(name == known.name for known in self.objects):
            raise ValueError(f"object {name!r} is already in the scene")
        if not frames:
            raise ValueError(f"object {name!r} has no frame")
        total = len(self.surfaces.objects) + sum(map(len, frames))
        total += 0 if mesh is None else len(mesh.triangles)
        if total > MAX_SURFACES:
            raise ValueError(
                f"with object {name!r} there are {total} primitives and triangles: "
                f"a scene holds at most {MAX_SURFACES}"
            )

    def _add_surfaces(self, added: GeomTable, mesh: Mesh | None) -> None:
        """Append primitives to the primitives and triangles to the triangles."""
        count, first_row = len(self.geoms.shapes), len(self._positions)
        self.geoms = appended(self.geoms, added)
        old: tuple[NDArray[Any], ...] = self.surfaces
        new: tuple[NDArray[Any], ...] = (added.colours, added.objects, added.frames)
        triangles: tuple[NDArray[Any], ...] = tuple(column[:0] for column in old)
        if mesh is not None:
            ids = np.full(len(mesh.owners), len(self.objects), np.int16)
            triangles = (mesh.colours, ids, mesh.owners + first_row)
            self.meshes = with_mesh(self.meshes, mesh, first_row)
        columns: list[Any] = [
            np.concatenate((rows[:count], geom_rows, rows[count:], triangle_rows))
            for rows, geom_rows, triangle_rows in zip(old, new, triangles, strict=True)
        ]
        self.surfaces = SurfaceTable(*columns)
        # shared memory: painting a primitive paints its surface
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
        """Compute all primitives and meshes from the frames. The world calls it once per step."""
        g = self.geoms
        compose(
            self._positions,
            self._rotations,
            g.frames,
            g.offsets,
            g.local_rotations,
            g.positions,
            g.rotations,
        )
        if len(self.meshes.vertices):
            deform_meshes(self.meshes, self._positions, self._rotations)
        self.version += 1

    def hidden(self, object_id: int, frames: Sequence[int]) -> Bools:
        """Return a mask ``(S,)`` that is true for all surfaces on the given frames of an object.

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
    """One named object in a scene.

    Attributes:
        id: Its value in segmentation images.
        name: Unique in the scene.
        rows: Its rows in the frame table.
        geoms: Its rows in the table of primitives.
        vertices: Its rows in the table of meshes; none if it has no mesh.
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
        """``(frames, 3)`` metres: a view that the owner writes into; `add_object` replaces it."""
        return self.scene.positions[self.rows]

    @property
    def rotations(self) -> Floats:
        """``(frames, 3, 3)``: a view that the owner writes into; `add_object` replaces it."""
        return self.scene.rotations[self.rows]

    @property
    def colour(self) -> Floats:
        """``(3,)``: a view of the colour of its first primitive, or of its first triangle."""
        first = self.geoms.start
        if self.geoms.start == self.geoms.stop:
            first = len(self.scene.geoms.shapes) + self.triangles.start
        colour: Floats = self.scene.surfaces.colours[first]
        return colour

    def paint(self, colour: tuple[float, float, float]) -> None:
        """Set the colour ``(red, green, blue)`` in [0, 1] of all its primitives and triangles."""
        check_colour(colour)
        colours, first = self.scene.surfaces.colours, len(self.scene.geoms.shapes)
        colours[self.geoms] = colour
        colours[first + self.triangles.start : first + self.triangles.stop] = colour
        self.scene.version += 1
