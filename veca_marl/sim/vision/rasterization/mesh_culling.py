"""Meshes in the depth and surface buffers, with culling of those that are hidden.

The axis-aligned bounding box of a mesh bounds the pixels that it may cover and its least depth. If
all of these pixels show a nearer surface already, or there are none, the mesh cannot change the
image and is skipped. With many bodies in several rooms this applies to most of them.
"""

from __future__ import annotations

from numba import njit

from veca_marl.sim.geometry import Bools, Floats, MeshTable
from veca_marl.sim.vision.mesh_rasterizer import draw_triangles, to_camera_frame
from veca_marl.sim.vision.rasterization.screen_bounds import box_intervals
from veca_marl.sim.vision.rasterizer import Depths, Lens, Surfaces, pixel_rectangle

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
    """Draw all meshes into the buffers, which hold the primitives already.

    Args:
        meshes: The scene's meshes.
        drawn: ``(T,)`` which of their triangles to draw.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        culled: Whether to skip hidden meshes; False draws all, the slow reference of the tests.
        first_surface: Index of the first triangle in `surfaces`; the others follow.
        seen: ``(V, 3)`` camera coordinates, written for meshes that are not skipped; see
            `to_camera_frame`.
        depth: ``(H, W)`` metres along the optical axis, updated where a nearer surface is hit.
        surfaces: ``(H, W)``, updated likewise.
    """
    for m in range(meshes.lower.shape[0]):
        if culled and is_occluded(meshes.lower[m], meshes.upper[m], view, lens, depth):
            continue
        begin, end = meshes.first_vertices[m], meshes.first_vertices[m + 1]
        to_camera_frame(meshes.vertices[begin:end], view, seen[begin:end])
        begin, end = meshes.first_triangles[m], meshes.first_triangles[m + 1]
        triangles, chosen = meshes.triangles[begin:end], drawn[begin:end]
        draw_triangles(triangles, seen, chosen, lens, first_surface + begin, depth, surfaces)


@njit(cache=True, error_model="numpy")
def is_occluded(lower: Floats, upper: Floats, view: Floats, lens: Lens, depth: Depths) -> bool:
    """Return whether a box is entirely hidden or outside of the image.

    Args:
        lower: ``(3,)`` metres, world frame: the least corner of an axis-aligned box.
        upper: ``(3,)`` the opposite corner.
        view: See `draw_meshes`.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres, of what is drawn already.
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
