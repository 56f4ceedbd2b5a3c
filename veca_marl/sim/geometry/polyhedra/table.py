"""Polyhedra as rows of numbers for compiled loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.sim.geometry.polyhedra.polyhedron import Polyhedron
from veca_marl.sim.geometry.poses import Floats

FACE_COLUMNS = 14
"""Columns of a row, which are outward normal (3), offset of the plane, three corners (9), and, in
the first row of a polyhedron, the number of its planes."""

PLANES_COLUMN = 13


def face_rows(polyhedron: Polyhedron) -> Floats:
    """Return the triangles of a polyhedron as rows ``(T, FACE_COLUMNS)``.

    The first rows have planes that are all different, so that loops over planes can leave the
    other triangles of the same faces out.
    """
    planes = np.column_stack([polyhedron.normals, polyhedron.offsets]).round(9)
    _, first = np.unique(planes, axis=0, return_index=True)
    others = np.setdiff1d(np.arange(len(planes)), first)
    order = np.concatenate([np.sort(first), others])
    rows = np.zeros((len(order), FACE_COLUMNS))
    rows[:, :3], rows[:, 3] = polyhedron.normals[order], polyhedron.offsets[order]
    rows[:, 4:13] = polyhedron.corners[order].reshape(-1, 9)
    rows[0, PLANES_COLUMN] = len(first)
    return rows


def sizes_of(polyhedron: Polyhedron, first_row: int) -> tuple[float, float, float]:
    """Return what the table of primitives stores in place of lengths.

    Returns:
        First row and number of rows in the table of faces, and the bounding radius in metres.
    """
    return float(first_row), float(len(polyhedron.triangles)), polyhedron.radius


def joined_rows(polyhedra: Sequence[Polyhedron]) -> Floats:
    """Return the rows of several polyhedra, one below the other."""
    return np.concatenate([np.zeros((0, FACE_COLUMNS)), *map(face_rows, polyhedra)])
