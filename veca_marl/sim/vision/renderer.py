"""Transparent primitives: any number of layers, blended from back to front.

Every transparent surface in front of the nearest opaque one is kept for each pixel, sorted by depth
(the A-buffer: Carpenter, "The A-buffer, an antialiased hidden surface method", SIGGRAPH 1984).
The picture therefore does not depend on the order in which objects were added. There are as many
layers as transparent surfaces one behind the other in the pixel with most of them, so that a
further layer costs only where it is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Bools, Floats, GeomTable, Shape
from veca_marl.sim.vision.rasterization.polyhedra import illuminate_polyhedra
from veca_marl.sim.vision.rasterizer import (
    NO_SURFACE,
    Depths,
    Lens,
    Surfaces,
    bounding_rectangle,
    draw_polyhedron,
    draw_rectangle,
    local_ray,
)
from veca_marl.sim.vision.shading import GLASS_OPACITY, Images, blend_colours, illuminate

_POLYHEDRON = int(Shape.POLYHEDRON)


class Layers(NamedTuple):
    """The transparent surfaces of one view.

    Attributes:
        depths: ``(L, H, W)`` float32 metres along the optical axis; void without a surface.
        surfaces: ``(L, H, W)`` int16 rows of primitives, nearest first; then `NO_SURFACE`.
    """

    depths: NDArray[np.float32]
    surfaces: NDArray[np.int16]


@njit(cache=True, error_model="numpy")
def collect_layers(
    geoms: GeomTable, drawn: Bools, view: Floats, lens: Lens, depth: Depths
) -> Layers:
    """Return the transparent surfaces in front of an image, sorted by depth.

    Args:
        geoms: The scene's primitives.
        drawn: ``(G,)`` which of them are transparent and drawn.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres, of the opaque surfaces.
    """
    scratch = depth.copy()
    hit = np.full(depth.shape, NO_SURFACE, np.int16)
    depths, surfaces = _layers(0, depth.shape)
    for g in range(geoms.shapes.shape[0]):
        if not drawn[g]:
            continue
        shape, size, surface = geoms.shapes[g], geoms.sizes[g], np.int16(g)
        ray = local_ray(geoms.positions[g], geoms.rotations[g], view)
        rectangle = bounding_rectangle(shape, size, ray, lens)
        first, end, top, bottom = rectangle
        if first < end and top < bottom and shape == _POLYHEDRON:
            faces, row = geoms.faces, int(size[0])
            draw_polyhedron(faces, row, ray, rectangle, lens, surface, scratch, hit)
        elif first < end and top < bottom:
            draw_rectangle(shape, size, ray, rectangle, lens, surface, scratch, hit)
        for j in range(top, bottom):
            for i in range(first, end):
                if hit[j, i] != g:
                    continue
                behind, t = _insert(depths, surfaces, j, i, surface, scratch[j, i])
                scratch[j, i] = depth[j, i]
                if behind != NO_SURFACE:
                    more_depths, more_surfaces = _layers(1, depth.shape)
                    more_depths[0, j, i], more_surfaces[0, j, i] = t, behind
                    depths = np.concatenate((depths, more_depths))
                    surfaces = np.concatenate((surfaces, more_surfaces))
    return Layers(depths, surfaces)


@njit(cache=True, error_model="numpy")
def _layers(count: int, size: tuple[int, int]) -> tuple[Depths, Surfaces]:
    """Return the depths and surfaces of empty layers."""
    return (
        np.empty((count, size[0], size[1]), np.float32),
        np.full((count, size[0], size[1]), NO_SURFACE, np.int16),
    )


@njit(cache=True, error_model="numpy")
def _insert(
    depths: Depths, surfaces: Surfaces, j: int, i: int, surface: np.int16, t: np.float32
) -> tuple[np.int16, np.float32]:
    """Insert a surface into the sorted layers of a pixel; return what is behind the last layer.

    The surface returned is `NO_SURFACE` if there was a free layer.
    """
    for layer in range(surfaces.shape[0]):
        present, at = surfaces[layer, j, i], depths[layer, j, i]
        if present == NO_SURFACE or t < at:
            surfaces[layer, j, i], depths[layer, j, i] = surface, t
            surface, t = present, at
            if surface == NO_SURFACE:
                break
    return surface, t


@njit(cache=True, error_model="numpy")
def blend_layers(
    geoms: GeomTable, colours: Depths, layers: Layers, view: Floats, lens: Lens, rgb: Images
) -> None:
    """Blend transparent surfaces over an image, from the farthest to the nearest.

    Args:
        geoms: The scene's primitives.
        colours: ``(S, 3)`` of the scene's surfaces, in [0, 1].
        layers: From `collect_layers`.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        rgb: ``(H, W, 3)``, updated.
    """
    lights = np.empty(rgb.shape[:2], np.float32)
    for layer in range(layers.surfaces.shape[0] - 1, -1, -1):
        surfaces = layers.surfaces[layer]
        illuminate(geoms, view, lens, layers.depths[layer], surfaces, lights)
        illuminate_polyhedra(geoms, view, lens, layers.depths[layer], surfaces, lights)
        blend_colours(colours, surfaces, lights, GLASS_OPACITY, rgb)
