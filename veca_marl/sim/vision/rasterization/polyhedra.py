"""Brightness of polyhedra, in a pass of its own: scenes without them pay nothing for it."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, GeomTable, Shape
from veca_marl.sim.geometry.polyhedra.distances import nearest_plane
from veca_marl.sim.vision.rasterizer import (
    NO_SURFACE,
    Depths,
    Lens,
    Surfaces,
    into_local,
    local_ray,
)
from veca_marl.sim.vision.shading import AMBIENT, BOUNCE, SUN, frame_ray, tile_run

_POLYHEDRON = int(Shape.POLYHEDRON)


@njit(cache=True, error_model="numpy")
def illuminate_polyhedra(
    geoms: GeomTable,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    lights: NDArray[np.float32],
) -> None:
    """Compute the brightness of the pixels that show polyhedra; see `illuminate`.

    Args:
        geoms: The scene's primitives.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` indices of the visible surfaces, `NO_SURFACE` for none.
        lights: ``(H, W)``, written where a polyhedron is visible.
    """
    if geoms.faces.shape[0] == 0:
        return
    width = surfaces.shape[1]
    for j in range(surfaces.shape[0]):
        end = 0
        while end < width:
            first, g = end, surfaces[j, end]
            while end < width and surfaces[j, end] == g:
                end += 1
            if g == NO_SURFACE or g >= geoms.shapes.shape[0] or geoms.shapes[g] != _POLYHEDRON:
                continue
            columns, run, lit = lens.columns[first:end], depth[j, first:end], lights[j, first:end]
            _light_faces(geoms, g, view, lens.rows[j], columns, run, lit)
            if geoms.checkers[g] > 0.0:
                ray = frame_ray(geoms, g, view)
                tile_run(ray, lens.rows[j], columns, run, geoms.checkers[g], lit)


@njit(cache=True, error_model="numpy")
def _light_faces(
    geoms: GeomTable,
    g: int,
    view: Floats,
    y: float,
    columns: Depths,
    depth: Depths,
    lights: NDArray[np.float32],
) -> None:
    """Compute the brightness of a run of pixels that show one polyhedron."""
    faces, size = geoms.faces, geoms.sizes[g]
    eye, right, up, forward = local_ray(geoms.positions[g], geoms.rotations[g], view)
    sun = into_local(geoms.rotations[g], SUN[0], SUN[1], SUN[2])
    start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
    solid = float(size[0]), float(size[1]), float(size[2])
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        px = eye[0] + t * (start[0] + x * right[0])
        py = eye[1] + t * (start[1] + x * right[1])
        pz = eye[2] + t * (start[2] + x * right[2])
        _, f = nearest_plane(faces, solid, px, py, pz)
        facing = faces[f, 0] * sun[0] + faces[f, 1] * sun[1] + faces[f, 2] * sun[2]
        lights[i] = AMBIENT + (1.0 - AMBIENT) * max(facing, 0.0) + BOUNCE * max(-facing, 0.0)
