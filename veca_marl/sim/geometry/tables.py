"""The arrays in which a scene keeps its primitives and surfaces: what compiled loops read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.primitives import Geom

Bools = NDArray[np.bool_]


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


def geom_table(frames: Sequence[Sequence[Geom]], object_id: int, first_row: int) -> GeomTable:
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


def joined(table: GeomTable, more: GeomTable) -> GeomTable:
    """Put the rows of one table below those of another."""
    above: tuple[NDArray[Any], ...] = table
    below: tuple[NDArray[Any], ...] = more
    columns: list[Any] = [np.concatenate(pair) for pair in zip(above, below, strict=True)]
    return GeomTable(*columns)


@njit(cache=True)
def compose(
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
