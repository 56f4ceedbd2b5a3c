"""Colours for a picture whose surfaces and depths are known: one pass, each pixel once.

A fixed sun from above, light from the sky that gives each side of a thing its own brightness, a
checker pattern where a primitive asks for one, and a sky that fades upwards.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from veca_marl.sim.pose import Floats
from veca_marl.sim.raster import NOTHING, Depths, Lens, Surfaces
from veca_marl.sim.scene import GeomTable, Shape
from veca_marl.sim.screen_bounds import Vector

Images = NDArray[np.uint8]

SUN = (0.358, 0.256, 0.898)  # unit vector towards it
AMBIENT = 0.45  # share of a colour that is seen where no sun falls
BOUNCE = 0.12  # share thrown back onto the sides that face away
DARK_TILE = 0.82  # brightness of every second tile of a checker pattern
SKY = (0.60, 0.75, 0.95)
GLASS_OPACITY = 0.3  # weight of a transparent primitive's own colour

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
# tiles start a little beside the origin, so that a face on a tile's edge does not flicker
_TILE_SHIFT = 0.01


@njit(cache=True, error_model="numpy")
def shade(
    geoms: GeomTable,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    rgb: Images,
) -> None:
    """Colour a picture.

    Args:
        geoms: The scene's primitives.
        view: ``(4, 3)`` position, right, up and forward axes of the eye in the world.
        lens: The camera's numbers.
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` rows of the primitives seen, `NOTHING` for the sky.
        rgb: ``(H, W, 3)``, written.
    """
    for j in range(lens.rows.shape[0]):
        y = lens.rows[j]
        for i in range(lens.columns.shape[0]):
            g = surfaces[j, i]
            if g == NOTHING:
                red, green, blue = _sky(y / lens.tan_y)
            else:
                red, green, blue = _lit(geoms, g, _point(view, lens.columns[i], y, depth[j, i]))
            rgb[j, i, 0] = _byte(red)
            rgb[j, i, 1] = _byte(green)
            rgb[j, i, 2] = _byte(blue)


@njit(cache=True, error_model="numpy")
def glaze(
    geoms: GeomTable,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    rgb: Images,
) -> None:
    """Blend the nearest transparent primitives over a coloured picture; arguments as `shade`."""
    for j in range(lens.rows.shape[0]):
        for i in range(lens.columns.shape[0]):
            g = surfaces[j, i]
            if g == NOTHING:
                continue
            tint = _lit(geoms, g, _point(view, lens.columns[i], lens.rows[j], depth[j, i]))
            for c in range(3):
                behind = rgb[j, i, c] / 255.0
                rgb[j, i, c] = _byte(GLASS_OPACITY * tint[c] + (1.0 - GLASS_OPACITY) * behind)


@njit(cache=True, error_model="numpy")
def name_objects(objects: Surfaces, surfaces: Surfaces) -> None:
    """Turn rows of primitives into object ids, in place; `NOTHING` stays."""
    for j in range(surfaces.shape[0]):
        for i in range(surfaces.shape[1]):
            if surfaces[j, i] != NOTHING:
                surfaces[j, i] = objects[surfaces[j, i]]


@njit(cache=True)
def _byte(value: float) -> np.uint8:
    return np.uint8(min(value, 1.0) * 255.0 + 0.5)


@njit(cache=True)
def _sky(height: float) -> Vector:
    """Sky colour at a height in the picture, -1 (bottom) to 1 (top)."""
    brightness = 0.875 + 0.125 * height
    return SKY[0] * brightness, SKY[1] * brightness, SKY[2] * brightness


@njit(cache=True)
def _point(view: Floats, x: float, y: float, depth: float) -> Vector:
    """World point at a depth on the ray through a pixel."""
    return (
        view[0, 0] + depth * (view[3, 0] + x * view[1, 0] + y * view[2, 0]),
        view[0, 1] + depth * (view[3, 1] + x * view[1, 1] + y * view[2, 1]),
        view[0, 2] + depth * (view[3, 2] + x * view[1, 2] + y * view[2, 2]),
    )


@njit(cache=True, error_model="numpy")
def _lit(geoms: GeomTable, g: int, point: Vector) -> Vector:
    """Colour of a primitive at a point of its surface (Lambert's cosine law plus ambient light)."""
    nx, ny, nz = _normal(geoms, g, point)
    facing = nx * SUN[0] + ny * SUN[1] + nz * SUN[2]
    light = AMBIENT + (1.0 - AMBIENT) * max(facing, 0.0) + BOUNCE * max(-facing, 0.0)
    if geoms.checkers[g] > 0.0 and _odd_tile(point, geoms.checkers[g]):
        light *= DARK_TILE
    colour = geoms.colours[g]
    return colour[0] * light, colour[1] * light, colour[2] * light


@njit(cache=True)
def _odd_tile(point: Vector, edge: float) -> bool:
    """Whether a point lies in a dark tile of a checker pattern in space."""
    total = 0
    for axis in range(3):
        total += math.floor(point[axis] / edge + _TILE_SHIFT)
    return total & 1 == 1


@njit(cache=True, error_model="numpy")
def _normal(geoms: GeomTable, g: int, point: Vector) -> Vector:
    """Outward unit normal of a primitive at a point of its surface, world axes."""
    rotation, centre = geoms.rotations[g], geoms.positions[g]
    ex, ey, ez = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    x = rotation[0, 0] * ex + rotation[1, 0] * ey + rotation[2, 0] * ez
    y = rotation[0, 1] * ex + rotation[1, 1] * ey + rotation[2, 1] * ez
    z = rotation[0, 2] * ex + rotation[1, 2] * ey + rotation[2, 2] * ez
    nx, ny, nz = _local_normal(geoms.shapes[g], geoms.sizes[g], x, y, z)
    return (
        rotation[0, 0] * nx + rotation[0, 1] * ny + rotation[0, 2] * nz,
        rotation[1, 0] * nx + rotation[1, 1] * ny + rotation[1, 2] * nz,
        rotation[2, 0] * nx + rotation[2, 1] * ny + rotation[2, 2] * nz,
    )


@njit(cache=True, error_model="numpy")
def _local_normal(shape: int, size: NDArray[np.float32], x: float, y: float, z: float) -> Vector:
    """Outward unit normal in the primitive's own axes."""
    if shape == _BOX:
        outside_x, outside_y, outside_z = abs(x) - size[0], abs(y) - size[1], abs(z) - size[2]
        if outside_x >= outside_y and outside_x >= outside_z:
            return math.copysign(1.0, x), 0.0, 0.0
        if outside_y >= outside_z:
            return 0.0, math.copysign(1.0, y), 0.0
        return 0.0, 0.0, math.copysign(1.0, z)
    radius, half_length = size[0], 0.5 * size[1]
    if shape == _SPHERE:
        return x / radius, y / radius, z / radius
    if shape == _CYLINDER:
        if abs(z) - half_length > math.sqrt(x * x + y * y) - radius:
            return 0.0, 0.0, math.copysign(1.0, z)
        return x / radius, y / radius, 0.0
    along = min(max(z, -half_length), half_length)
    return x / radius, y / radius, (z - along) / radius
