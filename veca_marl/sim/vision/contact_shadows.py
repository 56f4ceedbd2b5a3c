"""Soft contact shadows of primitives on the floor.

A floor point is darkened by its distance to the nearest primitive, as in ambient occlusion by
distance fields (Evans, "Fast approximations for global illumination on dynamic scenes", SIGGRAPH
2006 course): the field of several primitives is the least of their distances, so that the nineteen
bones of a hand darken the floor as one thing does. The distances are exact. All visible points in
the plane z = 0 count as floor; primitives larger than furniture cast no shadow.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import (
    Bools,
    Floats,
    GeomTable,
    Shape,
    Vector,
    bounding_radius,
    distance,
    single,
)
from veca_marl.sim.geometry.polyhedra import limited_distance
from veca_marl.sim.kernels import compiled, inlined, kernel
from veca_marl.sim.vision.rasterizer import (
    NO_SURFACE,
    Depths,
    Lens,
    Ray,
    Rectangle,
    Surfaces,
    box_intervals,
    pixel_rectangle,
)

# slopes, depths, surfaces and nearness of one row
Pixels: TypeAlias = tuple[Depths, Depths, Surfaces, NDArray[np.float32]]

REACH_M = 0.12  # greatest distance at which a primitive darkens a floor point
DARKNESS = 0.35  # fraction of the brightness removed at distance 0
LARGEST_M = 1.0  # bounding radius of the largest primitive that casts a shadow
_FLOOR_TOLERANCE_M = 0.01

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_CAPSULE, _POLYHEDRON = int(Shape.CAPSULE), int(Shape.POLYHEDRON)


@compiled
def darken_contact_shadows(
    geoms: GeomTable,
    casting: Bools,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    lights: NDArray[np.float32],
) -> None:
    """Darken floor pixels near primitives.

    Args:
        geoms: The scene's primitives.
        casting: ``(G,)`` which of them cast shadows.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` indices of the visible surfaces.
        lights: ``(H, W)`` brightness of each pixel, multiplied in place.
    """
    nearness = np.zeros_like(lights)
    _darken(geoms, casting, view, lens, depth, surfaces, nearness, lights)


@kernel
def _darken(
    geoms: GeomTable,
    casting: Bools,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    nearness: NDArray[np.float32],
    lights: NDArray[np.float32],
) -> None:
    """See `darken_contact_shadows`; `nearness` is 0, and overwritten by that of all primitives."""
    any_near = False
    for g in range(geoms.shapes.shape[0]):
        radius = bounding_radius(geoms.shapes[g], geoms.sizes[g])
        reach, height = radius + REACH_M, geoms.positions[g, 2]
        if not casting[g] or radius > LARGEST_M or abs(height) >= reach:
            continue
        around = math.sqrt(reach * reach - height * height)
        rectangle = _floor_rectangle(geoms.positions[g], around, view, lens)
        first, end, top, bottom = rectangle
        any_near |= first < end and top < bottom
        _approach(geoms, g, rectangle, view, lens, depth, surfaces, nearness)
    if not any_near:
        return
    for j in range(lights.shape[0]):
        for i in range(lights.shape[1]):
            lights[j, i] *= single(1.0 - DARKNESS * nearness[j, i] * nearness[j, i])


@kernel
def _floor_rectangle(position: Floats, around: float, view: Floats, lens: Lens) -> Rectangle:
    """Return the pixels that may show a square of the floor below a point."""
    ex, ey, ez = position[0] - view[0, 0], position[1] - view[0, 1], -view[0, 2]
    right = (view[1, 0], view[1, 1], view[1, 2])
    up = (view[2, 0], view[2, 1], view[2, 2])
    forward = (view[3, 0], view[3, 1], view[3, 2])
    centre = (
        ex * right[0] + ey * right[1] + ez * right[2],
        ex * up[0] + ey * up[1] + ez * up[2],
        ex * forward[0] + ey * forward[1] + ez * forward[2],
    )
    half = (around, around, _FLOOR_TOLERANCE_M)
    across, upward = box_intervals(centre, half, right, up, forward, lens.near)
    return pixel_rectangle(across, upward, lens)


@kernel
def _approach(
    geoms: GeomTable,
    g: int,
    rectangle: Rectangle,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    nearness: NDArray[np.float32],
) -> None:
    """Raise the nearness of the floor pixels of a rectangle to that of one primitive.

    It is 1 where they touch and 0 from `REACH_M` on.
    """
    first, end, top, bottom = rectangle
    columns = lens.columns[first:end]
    shape, size = geoms.shapes[g], _vector(geoms.sizes[g])
    turn = geoms.rotations[g].T
    frame = _vector(geoms.positions[g]), _vector(turn[0]), _vector(turn[1]), _vector(turn[2])
    eye = _vector(view[0]), _vector(view[1]), _vector(view[2]), _vector(view[3])
    for j in range(top, bottom):
        pixels = columns, depth[j, first:end], surfaces[j, first:end], nearness[j, first:end]
        # a constant shape per call keeps the loops free of branches
        if shape == _SPHERE:
            _approach_row(_SPHERE, size, frame, eye, lens.rows[j], g, pixels)
        elif shape == _BOX:
            _approach_row(_BOX, size, frame, eye, lens.rows[j], g, pixels)
        elif shape == _CYLINDER:
            _approach_row(_CYLINDER, size, frame, eye, lens.rows[j], g, pixels)
        elif shape == _POLYHEDRON:
            _approach_row_of_faces(geoms.faces, size, frame, eye, lens.rows[j], g, pixels)
        else:
            _approach_row(_CAPSULE, size, frame, eye, lens.rows[j], g, pixels)


@inlined
def _vector(array: NDArray[Any]) -> Vector:
    """Return three numbers of an array as scalars, which the compiler knows loops do not change."""
    return array[0], array[1], array[2]


@inlined
def _visible_point(eye: Ray, x: float, y: float, depth: float) -> Vector:
    """Return the point that a pixel shows, world frame; x and y are the slopes of its ray."""
    position, right, up, forward = eye
    return (
        position[0] + depth * (forward[0] + x * right[0] + y * up[0]),
        position[1] + depth * (forward[1] + x * right[1] + y * up[1]),
        position[2] + depth * (forward[2] + x * right[2] + y * up[2]),
    )


@inlined
def _in_frame(frame: Ray, point: Vector) -> Vector:
    """Return a point in the frame of a primitive: its position and its three axes."""
    origin, ahead, left, upward = frame
    dx, dy, dz = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    return (
        ahead[0] * dx + ahead[1] * dy + ahead[2] * dz,
        left[0] * dx + left[1] * dy + left[2] * dz,
        upward[0] * dx + upward[1] * dy + upward[2] * dz,
    )


@kernel
def _approach_row_of_faces(
    faces: Floats, size: Vector, frame: Ray, eye: Ray, y: float, name: int, pixels: Pixels
) -> None:
    """Raise the nearness of the floor pixels of a row to a polyhedron, see `_approach_row`."""
    columns, depth, names, nearness = pixels
    for i in range(columns.shape[0]):
        point = _visible_point(eye, columns[i], y, depth[i])
        if abs(point[2]) > _FLOOR_TOLERANCE_M or names[i] == NO_SURFACE or names[i] == name:
            continue
        local = _in_frame(frame, point)
        gap = limited_distance(faces, size, local[0], local[1], local[2], REACH_M)
        if gap >= REACH_M:
            continue
        near = single(1.0 - max(gap, 0.0) / REACH_M)
        nearness[i] = max(nearness[i], near)


@inlined
def _approach_row(
    shape: int,
    size: Vector,
    frame: Ray,
    eye: Ray,
    y: float,
    name: int,
    pixels: Pixels,
) -> None:
    """Raise the nearness of a row; the frame is a primitive's position and its three axes."""
    columns, depth, names, nearness = pixels
    for i in range(columns.shape[0]):
        point = _visible_point(eye, columns[i], y, depth[i])
        local = _in_frame(frame, point)
        gap = distance(shape, size, single(local[0]), single(local[1]), single(local[2]))
        gap = gap if gap > 0.0 else 0.0
        near = 1.0 - gap / REACH_M
        no_floor = abs(point[2]) > _FLOOR_TOLERANCE_M or names[i] == NO_SURFACE or names[i] == name
        near = 0.0 if no_floor or near < 0.0 else near
        nearness[i] = max(nearness[i], single(near))
