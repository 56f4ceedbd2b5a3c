"""Rendering of several views in one compiled call, which is a sixth faster than one per kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Bools, Floats, GeomTable, MeshTable, SurfaceTable
from veca_marl.sim.vision.contact_shadows import darken_contact_shadows
from veca_marl.sim.vision.mesh_rasterizer import illuminate_triangles
from veca_marl.sim.vision.rasterization.mesh_culling import draw_meshes
from veca_marl.sim.vision.rasterization.polyhedra import illuminate_polyhedra
from veca_marl.sim.vision.rasterizer import NO_SURFACE, Depths, Lens, Surfaces, draw_geoms
from veca_marl.sim.vision.renderer import blend_layers, collect_layers
from veca_marl.sim.vision.shading import Images, blend_colours, fill_sky, illuminate, to_object_ids


class Views(NamedTuple):
    """The images of V camera poses.

    Attributes:
        rgb: ``(V, H, W, 3)`` uint8.
        depth: ``(V, H, W)`` float32 metres along the optical axis to the nearest opaque surface;
            the camera's `far_m` where there is none.
        ids: ``(V, H, W)`` int16 id of that surface's object; -1 for the sky.
        glass_ids: ``(L, V, H, W)`` int16 ids of the transparent objects in front, nearest first,
            then -1. L is the number of layers in the pixel with most of them; it may be 0.
    """

    rgb: Images
    depth: Depths
    ids: Surfaces
    glass_ids: NDArray[np.int16]


class DrawMasks(NamedTuple):
    """Which surfaces are drawn, and how.

    Attributes:
        opaque: ``(G,)`` opaque primitives.
        glass: ``(G,)`` transparent primitives.
        casting: ``(G,)`` primitives that cast contact shadows, bones in place of the skin on them.
        triangles: ``(T,)`` triangles.
    """

    opaque: Bools
    glass: Bools
    casting: Bools
    triangles: Bools


@njit(cache=True, error_model="numpy")
def render_views(
    geoms: GeomTable,
    meshes: MeshTable,
    surfaces: SurfaceTable,
    drawn: DrawMasks,
    axes: Floats,
    lens: Lens,
    views: Views,
) -> NDArray[np.int16]:
    """Rasterize, light and colour all views.

    Args:
        geoms: The scene's primitives.
        meshes: The scene's meshes.
        surfaces: Colours, objects and frames of all primitives and triangles.
        drawn: Which of them to draw.
        axes: ``(V, 4, 3)`` position, right, up and forward axes of each camera, world frame.
        lens: Parameters of the camera.
        views: Written, except `glass_ids`.

    Returns:
        ``(L, V, H, W)`` the `Views.glass_ids`.
    """
    first = geoms.shapes.shape[0]
    lights = np.empty(views.depth.shape[1:], np.float32)
    seen = np.empty_like(meshes.vertices)
    has_glass = drawn.glass.any()
    count, height, width = views.ids.shape
    all_glass = np.empty((0, count, height, width), np.int16)
    for v in range(count):
        view, rgb, depth, ids = axes[v], views.rgb[v], views.depth[v], views.ids[v]
        depth[:], ids[:] = lens.far, NO_SURFACE
        draw_geoms(geoms, drawn.opaque, view, lens, True, depth, ids)
        draw_meshes(meshes, drawn.triangles, view, lens, True, first, seen, depth, ids)
        illuminate_triangles(meshes, seen, lens, first, ids, lights)
        illuminate(geoms, view, lens, depth, ids, lights)
        illuminate_polyhedra(geoms, view, lens, depth, ids, lights)
        darken_contact_shadows(geoms, drawn.casting, view, lens, depth, ids, lights)
        fill_sky(lens, rgb)
        blend_colours(surfaces.colours, ids, lights, 1.0, rgb)
        to_object_ids(surfaces.objects, ids)
        if has_glass:
            layers = collect_layers(geoms, drawn.glass, view, lens, depth)
            blend_layers(geoms, surfaces.colours, layers, view, lens, rgb)
            all_glass = with_glass(all_glass, v, surfaces.objects, layers.surfaces)
    return all_glass


@njit(cache=True, error_model="numpy")
def with_glass(
    all_glass: NDArray[np.int16], v: int, objects: Surfaces, layers: NDArray[np.int16]
) -> NDArray[np.int16]:
    """Return the ids of transparent objects in all views, with those of view `v` written.

    Args:
        all_glass: ``(K, V, H, W)``.
        v: Index of the view.
        objects: ``(S,)`` object ids of the surfaces.
        layers: ``(L, H, W)`` rows of surfaces; replaced by object ids.

    Returns:
        ``(max(K, L), V, H, W)``; further layers of the other views hold -1.
    """
    count, size = layers.shape[0], all_glass.shape
    if count > size[0]:
        more = np.full((count - size[0], size[1], size[2], size[3]), NO_SURFACE, np.int16)
        all_glass = np.concatenate((all_glass, more))
    for layer in range(count):
        to_object_ids(objects, layers[layer])
        all_glass[layer, v] = layers[layer]
    return all_glass
