"""Colours for a picture whose surfaces and depths are known: each pixel is lit once.

A fixed sun from above, light from all around that leaves the sides away from the sun visible, a
checker pattern where a primitive asks for one, and a sky that fades upwards. Light is computed in
the primitive's own axes along runs of pixels that see the same one, so that the inner loops are
short and without branches.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.geometry.pose import Floats
from veca_marl.sim.geometry.primitives import Shape
from veca_marl.sim.geometry.tables import GeomTable
from veca_marl.sim.geometry.vectors import Vector, single
from veca_marl.sim.vision.rasterizer import (
    NOTHING,
    Depths,
    Lens,
    Surfaces,
    into_local,
    local_ray,
)

Images: TypeAlias = NDArray[np.uint8]
Lights: TypeAlias = NDArray[np.float32]

SUN = (0.36, 0.26, 0.896)  # unit vector towards it
AMBIENT = 0.45  # share of a colour that is seen where no sun falls
BOUNCE = 0.12  # share thrown back onto the sides that face away
DARK_TILE = 0.82  # brightness of every second tile of a checker pattern
SKY = (0.60, 0.75, 0.95)
GLASS_OPACITY = 0.3  # weight of a transparent primitive's own colour

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_0, _1, _HALF, _255 = single(0.0), single(1.0), single(0.5), single(255.0)
_AMBIENT, _DIRECT, _BOUNCE = single(AMBIENT), single(1.0 - AMBIENT), single(BOUNCE)
# tiles start a little beside the origin, so that a face on a tile's edge does not flicker
_TILE_SHIFT = 0.01


@njit(cache=True, error_model="numpy")
def paint_sky(lens: Lens, rgb: Images) -> None:
    """Fill a picture ``(H, W, 3)`` with a sky that is lighter towards the top."""
    for j in range(rgb.shape[0]):
        brightness = 0.875 + 0.125 * lens.rows[j] / lens.tan_y
        for c in range(3):
            value = np.uint8(255.0 * SKY[c] * brightness + 0.5)
            for i in range(rgb.shape[1]):
                rgb[j, i, c] = value


@njit(cache=True, error_model="numpy")
def paint(colours: Lights, surfaces: Surfaces, lights: Lights, opacity: float, rgb: Images) -> None:
    """Lay the lit colours of the surfaces over a picture.

    Args:
        colours: ``(S, 3)`` of the scene's surfaces, in [0, 1].
        surfaces: ``(H, W)`` rows of the surfaces seen; where `NOTHING`, the picture stays.
        lights: ``(H, W)`` brightness of each pixel, as from `illuminate`.
        opacity: Weight of the new colours, in [0, 1].
        rgb: ``(H, W, 3)``, updated.
    """
    for j in range(rgb.shape[0]):
        for i in range(rgb.shape[1]):
            g = surfaces[j, i]
            if g == NOTHING:
                continue
            scale = single(opacity) * _255 * lights[j, i]
            for c in range(3):
                behind = single(1.0 - opacity) * single(rgb[j, i, c])
                mixed = scale * colours[g, c] + behind
                rgb[j, i, c] = np.uint8(min(mixed, _255) + _HALF)


@njit(cache=True, error_model="numpy")
def illuminate(
    geoms: GeomTable, view: Floats, lens: Lens, depth: Depths, surfaces: Surfaces, lights: Lights
) -> None:
    """Find how bright each pixel's surface is: Lambert's cosine law plus ambient light.

    Args:
        geoms: The scene's primitives.
        view: ``(4, 3)`` position, right, up and forward axes of the eye in the world.
        lens: The camera's numbers.
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` rows of the surfaces seen, `NOTHING` for none.
        lights: ``(H, W)``, written where a primitive is seen.
    """
    width = surfaces.shape[1]
    for j in range(surfaces.shape[0]):
        end = 0
        while end < width:
            first, g = end, surfaces[j, end]
            while end < width and surfaces[j, end] == g:
                end += 1
            if g == NOTHING or g >= geoms.shapes.shape[0]:
                continue
            columns, run = lens.columns[first:end], depth[j, first:end]
            _light_run(geoms, g, view, lens.rows[j], columns, run, lights[j, first:end])
            if geoms.checkers[g] > _0:
                _tile_run(view, lens.rows[j], columns, run, geoms.checkers[g], lights[j, first:end])


@njit(cache=True, error_model="numpy")
def _light_run(
    geoms: GeomTable,
    g: int,
    view: Floats,
    y: float,
    columns: Depths,
    depth: Depths,
    lights: Lights,
) -> None:
    """Light a run of pixels that see one primitive."""
    eye, right, up, forward = local_ray(geoms.positions[g], geoms.rotations[g], view)
    sun = into_local(geoms.rotations[g], SUN[0], SUN[1], SUN[2])
    start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
    shape, size = geoms.shapes[g], geoms.sizes[g]
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        point = (
            eye[0] + t * (start[0] + x * right[0]),
            eye[1] + t * (start[1] + x * right[1]),
            eye[2] + t * (start[2] + x * right[2]),
        )
        normal = _local_normal(shape, size, point)
        facing = normal[0] * sun[0] + normal[1] * sun[1] + normal[2] * sun[2]
        lights[i] = _AMBIENT + _DIRECT * max(facing, _0) + _BOUNCE * max(-facing, _0)


@njit(cache=True, error_model="numpy")
def _local_normal(shape: int, size: Lights, point: Vector) -> Vector:
    """Outward unit normal in a primitive's own axes."""
    x, y, z = point
    if shape == _BOX:
        ax, ay, az = abs(x) - size[0], abs(y) - size[1], abs(z) - size[2]
        is_x = ax >= max(ay, az)
        is_y = (ay >= az) & (not is_x)
        return (
            (_1 if x > _0 else -_1) if is_x else _0,
            (_1 if y > _0 else -_1) if is_y else _0,
            (_1 if z > _0 else -_1) if not (is_x | is_y) else _0,
        )
    radius, half_length = size[0], _HALF * size[1]
    if shape == _SPHERE:
        return x / radius, y / radius, z / radius
    if shape == _CYLINDER:
        is_end = abs(z) - half_length > math.sqrt(x * x + y * y) - radius
        return (
            _0 if is_end else x / radius,
            _0 if is_end else y / radius,
            (_1 if z > _0 else -_1) if is_end else _0,
        )
    along = min(max(z, -half_length), half_length)
    return x / radius, y / radius, (z - along) / radius


@njit(cache=True, error_model="numpy")
def _tile_run(
    view: Floats, y: float, columns: Depths, depth: Depths, edge_m: float, lights: Lights
) -> None:
    """Darken every second tile of a checker pattern that fills space."""
    per_m = 1.0 / edge_m
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        tile = 0
        for axis in range(3):
            along = view[3, axis] + x * view[1, axis] + y * view[2, axis]
            tile += math.floor((view[0, axis] + t * along) * per_m + _TILE_SHIFT)
        if tile & 1:
            lights[i] *= single(DARK_TILE)


@njit(cache=True, error_model="numpy")
def name_objects(objects: Surfaces, surfaces: Surfaces) -> None:
    """Turn rows of surfaces into object ids, in place; `NOTHING` stays."""
    for j in range(surfaces.shape[0]):
        for i in range(surfaces.shape[1]):
            if surfaces[j, i] != NOTHING:
                surfaces[j, i] = objects[surfaces[j, i]]
