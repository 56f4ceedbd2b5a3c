"""Rasterization of primitives into depth and surface buffers, within tight screen bounds.

Screen positions are slopes: a point at (right, up, forward) metres in the camera frame has the
slopes (right / forward, up / forward). An interval with its low end above its high end is empty.

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
from numpy.typing import NDArray

from veca_marl.sim.geometry import Bools, Floats, GeomTable, Shape, Vector, bounding_radius, single
from veca_marl.sim.kernels import compiled, kernel
from veca_marl.sim.vision.row_intersections import (
    box_row,
    capsule_row,
    cylinder_row,
    polyhedron_row,
    sphere_row,
    write_heights,
)

Interval: TypeAlias = tuple[float, float]

_EDGES_PER_AXIS = 4
# tangents beyond this angle from the optical axis (89 degrees) lie outside of every image
_GRAZING_RAD = 1.5533

Depths: TypeAlias = NDArray[np.float32]
Surfaces: TypeAlias = NDArray[np.int16]
Ray: TypeAlias = tuple[Vector, Vector, Vector, Vector]
Rectangle: TypeAlias = tuple[int, int, int, int]

NO_SURFACE = -1

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_POLYHEDRON = int(Shape.POLYHEDRON)
# a float32 constant keeps the loops in single precision: twice as many vector lanes
_HALF = single(0.5)


@kernel
def disc_interval(across: float, forward: float, radius: float, limit: float) -> Interval:
    """Return the slopes of the two tangents from the camera to a disc, cut to [-limit, limit].

    Args:
        across: Metres from the optical axis to the disc's centre, along one screen axis.
        forward: Metres to the disc's centre along the optical axis.
        radius: Metres.
        limit: Slope of the edge of the image.
    """
    squared = across * across + forward * forward - radius * radius
    if squared <= 0.0:
        return -limit, limit
    steep = forward * forward - radius * radius
    if forward > 0.0 and steep > 0.0:
        # the slopes s of the tangents: |across - s forward| = radius sqrt(1 + s^2)
        middle, half = across * forward, radius * math.sqrt(squared)
        return (middle - half) / steep, (middle + half) / steep
    if forward <= -radius:
        return limit, -limit
    # the disc crosses the plane of the camera: only one tangent bounds the part in front of it
    edge = _forward_tangent(abs(across), forward, radius)
    return (edge, limit) if across > 0.0 else (-limit, -edge)


@kernel
def _forward_tangent(across: float, forward: float, radius: float) -> float:
    """Return the slope of the tangent to a disc beside the camera, on the optical axis' side."""
    angle = math.atan2(across, forward)
    angle -= math.asin(radius / math.sqrt(across * across + forward * forward))
    return math.tan(angle) if angle < _GRAZING_RAD else math.inf


@kernel
def rod_interval(
    across: float,
    forward: float,
    axis_across: float,
    axis_forward: float,
    half_length: float,
    radius: float,
    limit: float,
) -> Interval:
    """Return bounds of the slopes of a capsule, and of the cylinder that it contains."""
    ahead = forward + half_length * axis_forward
    behind = forward - half_length * axis_forward
    if ahead * behind < 0.0:
        return -limit, limit  # the axis crosses the plane of the camera: no tangent bounds it
    one, other = across + half_length * axis_across, across - half_length * axis_across
    if one * other <= 0.0 and min(ahead, behind) <= 0.0 and max(ahead, behind) > -radius:
        # the axis passes behind the camera, from one side to the other, and the surface before it
        return -limit, limit
    low, high = disc_interval(one, ahead, radius, limit)
    other_low, other_high = disc_interval(other, behind, radius, limit)
    return min(low, other_low), max(high, other_high)


@kernel
def box_intervals(
    centre: Vector, half: Vector, right: Vector, up: Vector, forward: Vector, near: float
) -> tuple[Interval, Interval]:
    """Return bounds of the slopes (right, up) of a box, from its edges clipped at the near plane.

    Args:
        centre: The box's centre in the camera frame: (right, up, forward) metres.
        half: Half extents along the box's own axes.
        right: The camera's right axis in the box's own axes; likewise `up` and `forward`.
        up: See `right`.
        forward: See `right`.
        near: Metres; nothing nearer is drawn.
    """
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for edge in range(3 * _EDGES_PER_AXIS):
        axis, corner = edge // _EDGES_PER_AXIS, edge % _EDGES_PER_AXIS
        one = 1.0 if corner & 1 else -1.0
        two = 1.0 if corner & 2 else -1.0
        if axis == 0:
            start, end = (
                (half[0], one * half[1], two * half[2]),
                (-half[0], one * half[1], two * half[2]),
            )
        elif axis == 1:
            start, end = (
                (one * half[0], half[1], two * half[2]),
                (one * half[0], -half[1], two * half[2]),
            )
        else:
            start, end = (
                (one * half[0], two * half[1], half[2]),
                (one * half[0], two * half[1], -half[2]),
            )
        z0 = centre[2] + _dot(start, forward)
        z1 = centre[2] + _dot(end, forward)
        if z0 < near and z1 < near:
            continue
        x0, y0 = centre[0] + _dot(start, right), centre[1] + _dot(start, up)
        x1, y1 = centre[0] + _dot(end, right), centre[1] + _dot(end, up)
        if z0 < near:
            cut = (near - z0) / (z1 - z0)
            x0, y0, z0 = x0 + cut * (x1 - x0), y0 + cut * (y1 - y0), near
        elif z1 < near:
            cut = (near - z1) / (z0 - z1)
            x1, y1, z1 = x1 + cut * (x0 - x1), y1 + cut * (y0 - y1), near
        low_x, high_x = min(low_x, x0 / z0, x1 / z1), max(high_x, x0 / z0, x1 / z1)
        low_y, high_y = min(low_y, y0 / z0, y1 / z1), max(high_y, y0 / z0, y1 / z1)
    return (low_x, high_x), (low_y, high_y)


@kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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


@compiled
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
    heights = np.empty(len(geoms.faces))
    _draw_geoms(geoms, drawn, view, lens, bounded, heights, depth, surfaces)


@kernel
def _draw_geoms(
    geoms: GeomTable,
    drawn: Bools,
    view: Floats,
    lens: Lens,
    bounded: bool,
    heights: Floats,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """See `draw_geoms`; `heights` is overwritten, see `draw_polyhedron`."""
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
                geoms.faces,
                first_face,
                heights,
                ray,
                rectangle,
                lens,
                np.int16(g),
                depth,
                surfaces,
            )
        else:
            draw_rectangle(
                geoms.shapes[g], geoms.sizes[g], ray, rectangle, lens, np.int16(g), depth, surfaces
            )


@kernel
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


@kernel
def into_local(rotation: Floats, x: float, y: float, z: float) -> Vector:
    """Return a world vector in local axes, in single precision."""
    return (
        single(rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z),
        single(rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z),
        single(rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z),
    )


@kernel
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


@kernel
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


@kernel
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


@kernel
def draw_polyhedron(
    faces: Floats,
    first_face: int,
    heights: Floats,
    ray: Ray,
    rectangle: Rectangle,
    lens: Lens,
    surface: np.int16,
    depth: Depths,
    surfaces: Surfaces,
) -> None:
    """Intersect the rays of a rectangle with one polyhedron and update the buffers.

    `heights` is overwritten: ``(P,)`` for at least as many planes as the polyhedron has.
    """
    eye, right, up, forward = ray
    first, end, top, bottom = rectangle
    columns, near = lens.columns[first:end], lens.near
    count = write_heights(faces, first_face, eye, heights)
    for j in range(top, bottom):
        y = lens.rows[j]
        start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
        row, names = depth[j, first:end], surfaces[j, first:end]
        polyhedron_row(
            faces, first_face, heights[:count], start, right, columns, near, surface, row, names
        )
