"""Rasterization and lighting of triangles, into the same buffers as primitives.

Edge functions in homogeneous coordinates (Olano & Greer 1997, "Triangle scan conversion using 2D
homogeneous coordinates"): with the corners a, b, c in the camera frame, the ray of slopes (x, y)
hits the triangle if ``(b x c).(x, y, 1)`` and its two cyclic permutations are not negative, at the
depth ``det(a, b, c)`` over their sum. No clipping is needed, and adjacent triangles leave no gap:
their values for the common edge are equal with opposite signs.

The axis-aligned bounding box of a mesh bounds the pixels that it may cover and its least depth. If
all of these pixels show a nearer surface already, or there are none, the mesh cannot change the
image and is skipped. With many bodies in several rooms this applies to most of them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Bools, Floats, Indices, MeshTable, Vector, single
from veca_marl.sim.kernels import inlined, kernel
from veca_marl.sim.vision.rasterizer import (
    Depths,
    Interval,
    Lens,
    Rectangle,
    Surfaces,
    box_intervals,
    pixel_rectangle,
)
from veca_marl.sim.vision.shading import AMBIENT, BOUNCE, SUN

_MARGIN_PX = 0.01  # covers rounding errors of slopes in single precision

_ROUNDING_M = 1e-4  # depths are stored in single precision


@kernel
def to_camera_frame(vertices: Floats, view: Floats, seen: Floats) -> None:
    """Write vertices ``(V, 3)`` in the camera frame: metres right, up and forward.

    Args:
        vertices: World frame, metres.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        seen: ``(V, 3)``, written.
    """
    for v in range(vertices.shape[0]):
        x = vertices[v, 0] - view[0, 0]
        y = vertices[v, 1] - view[0, 1]
        z = vertices[v, 2] - view[0, 2]
        for axis in range(3):
            seen[v, axis] = view[axis + 1, 0] * x + view[axis + 1, 1] * y + view[axis + 1, 2] * z


@kernel
def draw_triangles(
    triangles: Indices,
    seen: Floats,
    drawn: Bools,
    lens: Lens,
    first_surface: int,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Draw the triangles that face the camera into a depth and a surface buffer.

    Args:
        triangles: ``(T, 3)`` vertices, counter-clockwise from outside.
        seen: ``(V, 3)`` vertices as from `to_camera_frame`.
        drawn: ``(T,)`` which of them to draw.
        lens: Parameters of the camera.
        first_surface: Index of the first triangle in `surfaces`; the others follow.
        depth: ``(H, W)`` metres along the optical axis, updated where a nearer surface is hit.
        surfaces: ``(H, W)``, updated likewise.
    """
    for t in range(triangles.shape[0]):
        if not drawn[t]:
            continue
        a, b, c = _at(seen, triangles[t, 0]), _at(seen, triangles[t, 1]), _at(seen, triangles[t, 2])
        farthest = max(a[2], b[2], c[2])
        nearest = min(a[2], b[2], c[2])
        if farthest <= lens.near or nearest > lens.far:
            continue
        over_a = _cross(b, c)
        volume = a[0] * over_a[0] + a[1] * over_a[1] + a[2] * over_a[2]
        if volume <= 0.0:  # back face
            continue
        rectangle = _rectangle(a, b, c, nearest, lens)
        if rectangle[0] < rectangle[1] and rectangle[2] < rectangle[3]:
            edges = (over_a, _cross(c, a), _cross(a, b))
            name = np.int16(first_surface + t)
            _fill(edges, volume, rectangle, lens, name, depth, surfaces)


@inlined
def _at(seen: Floats, vertex: int) -> Vector:
    return seen[vertex, 0], seen[vertex, 1], seen[vertex, 2]


@inlined
def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _rectangle(a: Vector, b: Vector, c: Vector, nearest: float, lens: Lens) -> Rectangle:
    """Return the pixels that a triangle may cover."""
    if nearest <= lens.near:
        return _cut_rectangle(a, b, c, lens)
    xa, xb, xc = a[0] / a[2], b[0] / b[2], c[0] / c[2]
    ya, yb, yc = a[1] / a[2], b[1] / b[2], c[1] / c[2]
    across = (min(xa, xb, xc), max(xa, xb, xc))
    upward = (min(ya, yb, yc), max(ya, yb, yc))
    return _centres_between(across, upward, lens)


@inlined
def _centres_between(across: Interval, upward: Interval, lens: Lens) -> Rectangle:
    """Return the pixels with centres between two pairs of slopes.

    As `pixel_rectangle` with a narrower margin: most triangles of a distant body contain no pixel
    centre, and a margin of one pixel would cost more than they do.
    """
    left, right = max(across[0], -lens.tan_x), min(across[1], lens.tan_x)
    bottom, top = max(upward[0], -lens.tan_y), min(upward[1], lens.tan_y)
    if left >= right or bottom >= top:
        return 0, 0, 0, 0
    width, height = lens.columns.shape[0], lens.rows.shape[0]
    per_x, per_y = width / (2.0 * lens.tan_x), height / (2.0 * lens.tan_y)
    reach = 0.5 + _MARGIN_PX
    return (
        max(math.ceil((left + lens.tan_x) * per_x - reach), 0),
        min(math.floor((right + lens.tan_x) * per_x + reach), width),
        max(math.ceil((lens.tan_y - top) * per_y - reach), 0),
        min(math.floor((lens.tan_y - bottom) * per_y + reach), height),
    )


@kernel
def _cut_rectangle(a: Vector, b: Vector, c: Vector, lens: Lens) -> Rectangle:
    """Return the pixels that a triangle crossing the near plane may cover, most often none.

    Such triangles belong mostly to the body of the eye itself.
    """
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    near = lens.near
    for side in range(3):
        start = a if side == 0 else (b if side == 1 else c)
        end = b if side == 0 else (c if side == 1 else a)
        if start[2] > near:
            x, y = start[0] / start[2], start[1] / start[2]
            low_x, high_x = min(low_x, x), max(high_x, x)
            low_y, high_y = min(low_y, y), max(high_y, y)
        if (start[2] > near) != (end[2] > near):
            cut = (near - start[2]) / (end[2] - start[2])
            x = (start[0] + cut * (end[0] - start[0])) / near
            y = (start[1] + cut * (end[1] - start[1])) / near
            low_x, high_x = min(low_x, x), max(high_x, x)
            low_y, high_y = min(low_y, y), max(high_y, y)
    return _centres_between((low_x, high_x), (low_y, high_y), lens)


@inlined
def _fill(
    edges: tuple[Vector, Vector, Vector],
    volume: float,
    rectangle: Rectangle,
    lens: Lens,
    name: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect the rays of a rectangle with one triangle and update the buffers."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = edges
    first, end, top, bottom = rectangle
    for j in range(top, bottom):
        y = lens.rows[j]
        a, b, c = ay * y + az, by * y + bz, cy * y + cz
        for i in range(first, end):
            x = lens.columns[i]
            u, v, w = a + ax * x, b + bx * x, c + cx * x
            if u < 0.0 or v < 0.0 or w < 0.0:
                continue
            total = u + v + w
            if volume > lens.near * total and volume < depth[j, i] * total:
                depth[j, i] = volume / total
                surfaces[j, i] = name


@kernel
def illuminate_triangles(
    meshes: MeshTable,
    seen: Floats,
    lens: Lens,
    first_surface: int,
    surfaces: Surfaces,
    lights: NDArray[np.float32],
) -> None:
    """Compute the brightness of the pixels that show triangles, as `illuminate` for primitives.

    The normal is interpolated between those of the corners (Phong 1975, "Illumination for computer
    generated pictures"), which makes a coarse mesh look smooth.

    Args:
        meshes: The scene's meshes.
        seen: ``(V, 3)`` vertices as from `to_camera_frame`.
        lens: Parameters of the camera.
        first_surface: As in `draw_triangles`.
        surfaces: ``(H, W)`` visible surfaces.
        lights: ``(H, W)``, written where a triangle is visible.
    """
    for j in range(surfaces.shape[0]):
        for i in range(surfaces.shape[1]):
            t = surfaces[j, i] - first_surface
            if t >= 0:
                lights[j, i] = _light(meshes, seen, t, lens.columns[i], lens.rows[j])


@inlined
def _light(meshes: MeshTable, seen: Floats, t: int, x: float, y: float) -> float:
    """Return the brightness of a triangle where the ray of slopes (x, y) hits it."""
    i, j, k = meshes.triangles[t, 0], meshes.triangles[t, 1], meshes.triangles[t, 2]
    a, b, c = _at(seen, i), _at(seen, j), _at(seen, k)
    u, v, w = _edge(b, c, x, y), _edge(c, a, x, y), _edge(a, b, x, y)
    squared, facing = 0.0, 0.0
    for axis in range(3):
        normal = (
            u * meshes.normals[i, axis] + v * meshes.normals[j, axis] + w * meshes.normals[k, axis]
        )
        squared += normal * normal
        facing += normal * SUN[axis]
    facing /= max(math.sqrt(squared), 1e-30)
    return single(AMBIENT + (1.0 - AMBIENT) * max(facing, 0.0) + BOUNCE * max(-facing, 0.0))


@inlined
def _edge(a: Vector, b: Vector, x: float, y: float) -> float:
    normal = _cross(a, b)
    return normal[0] * x + normal[1] * y + normal[2]


@kernel
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


@kernel
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
