"""Rasterization of primitives: ray casting within tight screen rectangles.

For every primitive the rays through the pixels of its bounding rectangle are intersected with it in
closed form, row by row, in its own axes. A depth buffer stores the nearest hit and a surface buffer
the index of the surface that was hit. The row loops have no branches, so that the compiler
vectorises them.

A ray is ``forward + x * right + y * up`` with slopes x and y, so that the parameter of a hit is its
distance along the optical axis. Only the outer side of a primitive is drawn: a camera inside of one
does not see it. Other rasterizers, such as `mesh_rasterizer`, fill the same two buffers before or
afterwards; only `shading` interprets the surface indices.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry import Bools, Floats, GeomTable, Shape, Vector, bounding_radius, single
from veca_marl.sim.geometry.polyhedra.intersections import heights_above, polyhedron_row
from veca_marl.sim.vision.rasterization.screen_bounds import (
    Interval,
    box_intervals,
    disc_interval,
    rod_interval,
)
from veca_marl.sim.vision.row_intersections import box_row, capsule_row, cylinder_row, sphere_row

Depths: TypeAlias = NDArray[np.float32]
Surfaces: TypeAlias = NDArray[np.int16]
Ray: TypeAlias = tuple[Vector, Vector, Vector, Vector]
Rectangle: TypeAlias = tuple[int, int, int, int]

NO_SURFACE = -1

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_POLYHEDRON = int(Shape.POLYHEDRON)
# a float32 constant keeps the loops in single precision: twice as many vector lanes
_HALF = single(0.5)


class Lens(NamedTuple):
    """Intrinsic parameters of a pinhole camera for compiled loops; scalars in single precision.

    Attributes:
        columns: ``(W,)`` float32 slope to the right of each column's centre.
        rows: ``(H,)`` float32 upward slope of each row's centre, upper row first.
        tan_x: Slope of the right edge of the image.
        tan_y: Slope of the upper edge of the image.
        near: Metres; nearer surfaces are not drawn.
        far: Metres; the depth of pixels without a surface.
    """

    columns: NDArray[np.float32]
    rows: NDArray[np.float32]
    tan_x: float
    tan_y: float
    near: float
    far: float


@njit(cache=True, error_model="numpy")
def draw_geoms(
    geoms: GeomTable,
    drawn: Bools,
    view: Floats,
    lens: Lens,
    bounded: bool,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Draw primitives into a depth and a surface buffer.

    Args:
        geoms: The scene's primitives.
        drawn: ``(G,)`` which of them to draw.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        bounded: Whether to restrict each primitive to its bounding rectangle; False covers the
            whole image, the slow reference of the tests.
        depth: ``(H, W)`` metres along the optical axis, updated where a nearer surface is hit.
        surfaces: ``(H, W)`` row of the visible primitive, updated likewise.
    """
    for g in range(geoms.shapes.shape[0]):
        if not drawn[g]:
            continue
        ray = local_ray(geoms.positions[g], geoms.rotations[g], view)
        rectangle = (0, lens.columns.shape[0], 0, lens.rows.shape[0])
        if bounded:
            rectangle = bounding_rectangle(geoms.shapes[g], geoms.sizes[g], ray, lens)
        if rectangle[0] >= rectangle[1] or rectangle[2] >= rectangle[3]:
            continue
        if geoms.shapes[g] == _POLYHEDRON:
            first_face = int(geoms.sizes[g, 0])
            draw_polyhedron(
                geoms.faces, first_face, ray, rectangle, lens, np.int16(g), depth, surfaces
            )
        else:
            draw_rectangle(
                geoms.shapes[g], geoms.sizes[g], ray, rectangle, lens, np.int16(g), depth, surfaces
            )


@njit(cache=True, error_model="numpy")
def local_ray(position: Floats, rotation: Floats, view: Floats) -> Ray:
    """Return camera position and right, up and forward axes in a primitive's own axes."""
    return (
        into_local(
            rotation, view[0, 0] - position[0], view[0, 1] - position[1], view[0, 2] - position[2]
        ),
        into_local(rotation, view[1, 0], view[1, 1], view[1, 2]),
        into_local(rotation, view[2, 0], view[2, 1], view[2, 2]),
        into_local(rotation, view[3, 0], view[3, 1], view[3, 2]),
    )


@njit(cache=True, error_model="numpy")
def into_local(rotation: Floats, x: float, y: float, z: float) -> Vector:
    """Return a world vector in local axes, in single precision."""
    return (
        single(rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z),
        single(rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z),
        single(rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z),
    )


@njit(cache=True, error_model="numpy")
def bounding_rectangle(shape: int, size: NDArray[np.float32], ray: Ray, lens: Lens) -> Rectangle:
    """Return pixels (first column, last + 1, first row, last + 1) that a primitive may cover."""
    eye, right, up, forward = ray
    centre = (
        -(eye[0] * right[0] + eye[1] * right[1] + eye[2] * right[2]),
        -(eye[0] * up[0] + eye[1] * up[1] + eye[2] * up[2]),
        -(eye[0] * forward[0] + eye[1] * forward[1] + eye[2] * forward[2]),
    )
    tan_x, tan_y, near = lens.tan_x, lens.tan_y, lens.near
    reach = bounding_radius(shape, size)
    if centre[2] + reach < near or centre[2] - reach > lens.far:
        return 0, 0, 0, 0
    if shape == _BOX:
        half = (size[0], size[1], size[2])
        across, upward = box_intervals(centre, half, right, up, forward, near)
    elif shape == _SPHERE:
        across = disc_interval(centre[0], centre[2], size[0], tan_x)
        upward = disc_interval(centre[1], centre[2], size[0], tan_y)
    elif shape == _POLYHEDRON:
        across = disc_interval(centre[0], centre[2], reach, tan_x)
        upward = disc_interval(centre[1], centre[2], reach, tan_y)
    else:
        half_length = _HALF * size[1]
        across = rod_interval(
            centre[0], centre[2], right[2], forward[2], half_length, size[0], tan_x
        )
        upward = rod_interval(centre[1], centre[2], up[2], forward[2], half_length, size[0], tan_y)
    return pixel_rectangle(across, upward, lens)


@njit(cache=True, error_model="numpy")
def pixel_rectangle(across: Interval, upward: Interval, lens: Lens) -> Rectangle:
    """Return the pixels with centres between two pairs of slopes; empty outside of the image."""
    left, right = max(across[0], -lens.tan_x), min(across[1], lens.tan_x)
    bottom, top = max(upward[0], -lens.tan_y), min(upward[1], lens.tan_y)
    if left >= right or bottom >= top:
        return 0, 0, 0, 0
    width, height = lens.columns.shape[0], lens.rows.shape[0]
    per_x, per_y = width / (2.0 * lens.tan_x), height / (2.0 * lens.tan_y)
    # one pixel of margin covers rounding errors
    return (
        max(math.floor((left + lens.tan_x) * per_x - 1.0), 0),
        min(math.ceil((right + lens.tan_x) * per_x + 1.0), width),
        max(math.floor((lens.tan_y - top) * per_y - 1.0), 0),
        min(math.ceil((lens.tan_y - bottom) * per_y + 1.0), height),
    )


@njit(cache=True, error_model="numpy")
def draw_rectangle(
    shape: int,
    size: NDArray[np.float32],
    ray: Ray,
    rectangle: Rectangle,
    lens: Lens,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect the rays of a rectangle with one primitive and update the buffers.

    For polyhedra see `draw_polyhedron`.
    """
    eye, right, up, forward = ray
    first, end, top, bottom = rectangle
    columns, near = lens.columns[first:end], lens.near
    for j in range(top, bottom):
        y = lens.rows[j]
        start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
        row, names = depth[j, first:end], surfaces[j, first:end]
        if shape == _SPHERE:
            sphere_row(size[0], eye, start, right, columns, near, surface, row, names)
        elif shape == _BOX:
            half = (size[0], size[1], size[2])
            box_row(half, eye, start, right, columns, near, surface, row, names)
        elif shape == _CYLINDER:
            half_length = _HALF * size[1]
            cylinder_row(
                size[0], half_length, eye, start, right, columns, near, surface, row, names
            )
        else:
            half_length = _HALF * size[1]
            capsule_row(size[0], half_length, eye, start, right, columns, near, surface, row, names)


@njit(cache=True, error_model="numpy")
def draw_polyhedron(
    faces: Floats,
    first_face: int,
    ray: Ray,
    rectangle: Rectangle,
    lens: Lens,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect the rays of a rectangle with one polyhedron and update the buffers."""
    eye, right, up, forward = ray
    first, end, top, bottom = rectangle
    columns, near = lens.columns[first:end], lens.near
    heights = heights_above(faces, first_face, eye)
    for j in range(top, bottom):
        y = lens.rows[j]
        start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
        row, names = depth[j, first:end], surfaces[j, first:end]
        polyhedron_row(faces, first_face, heights, start, right, columns, near, surface, row, names)
