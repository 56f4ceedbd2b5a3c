"""Skins into the depth and surface buffers: those outside the picture or behind walls cost nothing.

A box round each skin says which pixels it may cover and how near it may come. Where all of them
show something nearer already, or there are none, none of its triangles could change anything, so
that leaving it out does not change a bit of the picture. With many bodies in many rooms that is
what most of them are.
"""

from __future__ import annotations

from numba import njit

from veca_marl.sim.geometry.meshes import MeshTable
from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.tables import Bools
from veca_marl.sim.vision.mesh_rasterizer import draw_triangles, to_camera_frame
from veca_marl.sim.vision.rasterizer import Depths, Lens, Surfaces, pixel_rectangle
from veca_marl.sim.vision.screen_bounds import box_intervals

_ROUNDING_M = 1e-4  # depths are stored in single precision


@njit(cache=True, error_model="numpy")
def draw_meshes(
    meshes: MeshTable,
    drawn: Bools,
    view: Floats,
    lens: Lens,
    culled: bool,
    first_surface: int,
    seen: Floats,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Draw all skins over what was drawn before.

    Args:
        meshes: The scene's skins.
        drawn: ``(T,)`` which of their triangles to draw.
        view: ``(4, 3)`` position, right, up and forward axes of the eye in the world.
        lens: The camera's numbers.
        culled: Leave out skins that cannot be seen; false draws all, which is the slow truth that
            tests compare with.
        first_surface: What the first triangle is called in `surfaces`; the next one more.
        seen: ``(V, 3)`` written for the skins that were not left out, see `to_camera_frame`.
        depth: ``(H, W)`` metres along the optical axis, updated where something nearer is hit.
        surfaces: ``(H, W)``, updated likewise.
    """
    for m in range(meshes.lower.shape[0]):
        if culled and is_hidden(meshes.lower[m], meshes.upper[m], view, lens, depth):
            continue
        begin, end = meshes.first_vertices[m], meshes.first_vertices[m + 1]
        to_camera_frame(meshes.vertices[begin:end], view, seen[begin:end])
        begin, end = meshes.first_triangles[m], meshes.first_triangles[m + 1]
        triangles, chosen = meshes.triangles[begin:end], drawn[begin:end]
        draw_triangles(triangles, seen, chosen, lens, first_surface + begin, depth, surfaces)


@njit(cache=True, error_model="numpy")
def is_hidden(lower: Floats, upper: Floats, view: Floats, lens: Lens, depth: Depths) -> bool:
    """Say whether nothing in a box can be seen.

    Args:
        lower: ``(3,)`` metres, world frame: a corner of the box, whose edges are along the axes.
        upper: ``(3,)`` the opposite corner.
        view: See `draw_meshes`.
        lens: The camera's numbers.
        depth: ``(H, W)`` how near what was drawn before is.
    """
    half = (
        (upper[0] - lower[0]) / 2.0,
        (upper[1] - lower[1]) / 2.0,
        (upper[2] - lower[2]) / 2.0,
    )
    x = lower[0] + half[0] - view[0, 0]
    y = lower[1] + half[1] - view[0, 1]
    z = lower[2] + half[2] - view[0, 2]
    right = (view[1, 0], view[1, 1], view[1, 2])
    up = (view[2, 0], view[2, 1], view[2, 2])
    forward = (view[3, 0], view[3, 1], view[3, 2])
    centre = (
        x * right[0] + y * right[1] + z * right[2],
        x * up[0] + y * up[1] + z * up[2],
        x * forward[0] + y * forward[1] + z * forward[2],
    )
    reach = abs(forward[0]) * half[0] + abs(forward[1]) * half[1] + abs(forward[2]) * half[2]
    if centre[2] + reach <= lens.near:
        return True
    across, upward = box_intervals(centre, half, right, up, forward, lens.near)
    first, end, top, bottom = pixel_rectangle(across, upward, lens)
    nearest = centre[2] - reach - _ROUNDING_M
    for j in range(top, bottom):
        for i in range(first, end):
            if depth[j, i] > nearest:
                return False
    return True
