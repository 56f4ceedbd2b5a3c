"""All passes of rendering one view after the other, with any number of transparent layers.

Every transparent surface in front of the nearest opaque one is kept for each pixel, sorted by depth
(the A-buffer: Carpenter, "The A-buffer, an antialiased hidden surface method", SIGGRAPH 1984).
The picture therefore does not depend on the order in which objects were added. There are as many
layers as transparent surfaces one behind the other in the pixel with most of them, so that a
further layer costs only where it is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Bools, Floats, GeomTable, MeshTable, Shape, SurfaceTable
from veca_marl.sim.kernels import compiled, kernel
from veca_marl.sim.vision.contact_shadows import darken_contact_shadows
from veca_marl.sim.vision.mesh_rasterizer import draw_meshes, illuminate_triangles
from veca_marl.sim.vision.rasterizer import (
    NO_SURFACE,
    Depths,
    Lens,
    Surfaces,
    bounding_rectangle,
    draw_geoms,
    draw_polyhedron,
    draw_rectangle,
    local_ray,
)
from veca_marl.sim.vision.shading import (
    GLASS_OPACITY,
    Images,
    blend_colours,
    colour_planes,
    illuminate,
    illuminate_polyhedra,
    to_object_ids,
)

_POLYHEDRON = int(Shape.POLYHEDRON)


class Layers(NamedTuple):
    """The transparent surfaces of one view.

    Attributes:
        depths: ``(L, H, W)`` float32 metres along the optical axis; void without a surface.
        surfaces: ``(L, H, W)`` int16 rows of primitives, nearest first; then `NO_SURFACE`.
    """

    depths: NDArray[np.float32]
    surfaces: NDArray[np.int16]


@compiled
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
    heights = np.empty(len(geoms.faces))  # see `draw_polyhedron`
    for g in range(geoms.shapes.shape[0]):
        if not drawn[g]:
            continue
        shape, size, surface = geoms.shapes[g], geoms.sizes[g], np.int16(g)
        ray = local_ray(geoms.positions[g], geoms.rotations[g], view)
        rectangle = bounding_rectangle(shape, size, ray, lens)
        first, end, top, bottom = rectangle
        if first < end and top < bottom and shape == _POLYHEDRON:
            faces, row = geoms.faces, int(size[0])
            draw_polyhedron(faces, row, heights, ray, rectangle, lens, surface, scratch, hit)
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


@compiled
def _layers(count: int, size: tuple[int, int]) -> tuple[Depths, Surfaces]:
    """Return the depths and surfaces of empty layers."""
    return (
        np.empty((count, size[0], size[1]), np.float32),
        np.full((count, size[0], size[1]), NO_SURFACE, np.int16),
    )


@kernel
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


@compiled
def blend_layers(
    geoms: GeomTable, colours: Depths, layers: Layers, view: Floats, lens: Lens, planes: Images
) -> None:
    """Blend transparent surfaces over an image, from the farthest to the nearest.

    Args:
        geoms: The scene's primitives.
        colours: ``(S, 3)`` of the scene's surfaces, in [0, 1].
        layers: From `collect_layers`.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        planes: ``(3, H, W)``, updated.
    """
    lights = np.empty(planes.shape[1:], np.float32)
    for layer in range(layers.surfaces.shape[0] - 1, -1, -1):
        surfaces = layers.surfaces[layer]
        illuminate(geoms, view, lens, layers.depths[layer], surfaces, lights)
        illuminate_polyhedra(geoms, view, lens, layers.depths[layer], surfaces, lights)
        blend_colours(colours, surfaces, lights, GLASS_OPACITY, planes)


class Views(NamedTuple):
    """The images of V camera poses.

    Attributes:
        planes: ``(V, 3, H, W)`` uint8: red, green, blue.
        depth: ``(V, H, W)`` float32 metres along the optical axis to the nearest opaque surface;
            the camera's `far_m` where there is none.
        ids: ``(V, H, W)`` int16 id of that surface's object; -1 for the sky.
        glass_ids: ``(L, V, H, W)`` int16 ids of the transparent objects in front, nearest first,
            then -1. L is the number of layers in the pixel with most of them; it may be 0.
    """

    planes: Images
    depth: Depths
    ids: Surfaces
    glass_ids: NDArray[np.int16]

    @property
    def rgb(self) -> Images:
        """The colours as ``(V, H, W, 3)``: a view of `planes`, which is not contiguous."""
        return self.planes.transpose(0, 2, 3, 1)


class DrawMasks(NamedTuple):
    """Which surfaces are drawn, and how.

    Attributes:
        opaque: ``(G,)`` opaque primitives.
        glass: ``(G,)`` transparent primitives.
        casting: ``(G,)`` primitives that cast contact shadows: tangible ones, of bodies the bones.
        triangles: ``(T,)`` triangles.
    """

    opaque: Bools
    glass: Bools
    casting: Bools
    triangles: Bools


@compiled
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
        view, planes, depth, ids = axes[v], views.planes[v], views.depth[v], views.ids[v]
        depth[:], ids[:] = lens.far, NO_SURFACE
        draw_geoms(geoms, drawn.opaque, view, lens, True, depth, ids)
        draw_meshes(meshes, drawn.triangles, view, lens, True, first, seen, depth, ids)
        illuminate_triangles(meshes, seen, lens, first, ids, lights)
        illuminate(geoms, view, lens, depth, ids, lights)
        illuminate_polyhedra(geoms, view, lens, depth, ids, lights)
        darken_contact_shadows(geoms, drawn.casting, view, lens, depth, ids, lights)
        colour_planes(lens, surfaces.colours, ids, lights, planes)
        to_object_ids(surfaces.objects, ids)
        if has_glass:
            layers = collect_layers(geoms, drawn.glass, view, lens, depth)
            blend_layers(geoms, surfaces.colours, layers, view, lens, planes)
            all_glass = with_glass(all_glass, v, surfaces.objects, layers.surfaces)
    return all_glass


@compiled
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
        for j in range(size[2]):  # the assignment of an array takes 2 s more to compile
            for i in range(size[3]):
                all_glass[layer, v, j, i] = layers[layer, j, i]
    return all_glass
