"""Pictures of a scene from several poses in one go: calls of single kernels took a sixth more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from veca_marl.sim.geometry.meshes import MeshTable
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.tables import Bools, GeomTable, SurfaceTable
from veca_marl.sim.vision.contact_shadows import darken_contacts
from veca_marl.sim.vision.mesh_culling import draw_meshes
from veca_marl.sim.vision.mesh_rasterizer import illuminate_triangles
from veca_marl.sim.vision.rasterizer import (
    NOTHING,
    Depths,
    Lens,
    Surfaces,
    draw_geoms,
)
from veca_marl.sim.vision.shading import (
    GLASS_OPACITY,
    Images,
    illuminate,
    name_objects,
    paint,
    paint_sky,
)


class Views(NamedTuple):
    """What a camera saw from V poses.

    Attributes:
        rgb: ``(V, H, W, 3)`` uint8.
        depth: ``(V, H, W)`` float32 metres along the optical axis to what is not transparent; the
            camera's `far_m` where there is nothing.
        ids: ``(V, H, W)`` int16 id of the object seen, through transparent ones; -1 for the sky.
        glass_ids: ``(V, H, W)`` int16 id of the nearest transparent object in front, or -1.
    """

    rgb: Images
    depth: Depths
    ids: Surfaces
    glass_ids: Surfaces


class Drawn(NamedTuple):
    """Masks of what is drawn and how.

    Attributes:
        opaque: ``(G,)`` primitives that hide what is behind them.
        glass: ``(G,)`` primitives that do not.
        casting: ``(G,)`` primitives that cast shadows: bones do so for the skin on them.
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
    drawn: Drawn,
    axes: Floats,
    lens: Lens,
    views: Views,
) -> None:
    """Draw and light all views.

    Args:
        geoms: The scene's primitives.
        meshes: The scene's skins.
        surfaces: What pixels can show.
        drawn: What of it to draw.
        axes: ``(V, 4, 3)`` position, right, up and forward axes of each eye in the world.
        lens: The camera's numbers.
        views: Written.
    """
    first = geoms.shapes.shape[0]
    lights = np.empty(views.depth.shape[1:], np.float32)
    seen = np.empty_like(meshes.vertices)
    has_glass = drawn.glass.any()
    for v in range(axes.shape[0]):
        view, rgb, depth = axes[v], views.rgb[v], views.depth[v]
        ids, glass_ids = views.ids[v], views.glass_ids[v]
        depth[:], ids[:], glass_ids[:] = lens.far, NOTHING, NOTHING
        draw_geoms(geoms, drawn.opaque, view, lens, True, depth, ids)
        draw_meshes(meshes, drawn.triangles, view, lens, True, first, seen, depth, ids)
        illuminate_triangles(meshes, seen, lens, first, ids, lights)
        illuminate(geoms, view, lens, depth, ids, lights)
        darken_contacts(geoms, drawn.casting, view, lens, depth, ids, lights)
        paint_sky(lens, rgb)
        paint(surfaces.colours, ids, lights, 1.0, rgb)
        name_objects(surfaces.objects, ids)
        if has_glass:
            glass_depth = depth.copy()
            draw_geoms(geoms, drawn.glass, view, lens, True, glass_depth, glass_ids)
            illuminate(geoms, view, lens, glass_depth, glass_ids, lights)
            paint(surfaces.colours, glass_ids, lights, GLASS_OPACITY, rgb)
            name_objects(surfaces.objects, glass_ids)
