"""Deferred shading: colours of an image from its surface and depth buffers, once per pixel.

Lambert's cosine law for one directional light, an ambient term, light reflected from below, an
optional checker pattern, and a vertical gradient for the sky. Brightness is computed in the
primitive's own axes along runs of pixels that show the same primitive, so that the inner loops have
no branches.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, GeomTable, Shape, Vector, single
from veca_marl.sim.geometry.polyhedra import nearest_plane
from veca_marl.sim.kernels import inlined, kernel
from veca_marl.sim.vision.rasterizer import (
    NO_SURFACE,
    Depths,
    Lens,
    Ray,
    Surfaces,
    into_local,
    local_ray,
)

Images: TypeAlias = NDArray[np.uint8]
Lights: TypeAlias = NDArray[np.float32]
Point: TypeAlias = tuple[float, float, float]
FrameRay: TypeAlias = tuple[Point, Point, Point, Point]

SUN = (0.36, 0.26, 0.896)  # unit vector towards the directional light
AMBIENT = 0.45  # brightness of surfaces parallel to the light
BOUNCE = 0.12  # brightness added to surfaces that face away from the light
DARK_TILE = 0.82  # brightness of every second tile of a checker pattern
SKY = (0.60, 0.75, 0.95)
GLASS_OPACITY = 0.3  # weight of a transparent primitive's own colour

_SPHERE, _BOX, _CYLINDER = int(Shape.SPHERE), int(Shape.BOX), int(Shape.CYLINDER)
_0, _1, _HALF, _255 = single(0.0), single(1.0), single(0.5), single(255.0)
_AMBIENT, _DIRECT, _BOUNCE = single(AMBIENT), single(1.0 - AMBIENT), single(BOUNCE)
_ORIGIN = (0.0, 0.0, 0.0)
# offset of the tiles from the origin, so that a face in the plane of tile edges does not flicker
_TILE_SHIFT = 0.01

_POLYHEDRON = int(Shape.POLYHEDRON)


@kernel
def colour_planes(
    lens: Lens, colours: Lights, surfaces: Surfaces, lights: Lights, planes: Images
) -> None:
    """Write the lit colours of the surfaces, and the sky where there is none.

    The sky is a vertical gradient, lighter towards the top. Planes are written along runs of pixels
    that show one surface, so that the inner loops look up nothing.

    Args:
        lens: Parameters of the camera.
        colours: ``(S, 3)`` of the scene's surfaces, in [0, 1].
        surfaces: ``(H, W)`` indices of the visible surfaces, `NO_SURFACE` for the sky.
        lights: ``(H, W)`` brightness of each pixel, as from `illuminate`.
        planes: ``(3, H, W)``, written.
    """
    height, width = surfaces.shape
    for j in range(height):
        sky = 0.875 + 0.125 * lens.rows[j] / lens.tan_y
        end = 0
        while end < width:
            first, g = end, surfaces[j, end]
            while end < width and surfaces[j, end] == g:
                end += 1
            for c in range(3):
                run = planes[c, j, first:end]
                if g == NO_SURFACE:
                    run[:] = np.uint8(255.0 * SKY[c] * sky + 0.5)
                else:
                    _colour_run(colours[g, c], lights[j, first:end], run)


@kernel
def _colour_run(colour: float, lights: Lights, run: Images) -> None:
    """Write one plane of the lit colour of a surface along a run of pixels."""
    for i in range(run.shape[0]):
        run[i] = np.uint8(np.int32(min(_255 * lights[i] * colour, _255) + _HALF))


@kernel
def blend_colours(
    colours: Lights, surfaces: Surfaces, lights: Lights, opacity: float, planes: Images
) -> None:
    """Blend the lit colours of the surfaces over an image.

    Args:
        colours: ``(S, 3)`` of the scene's surfaces, in [0, 1].
        surfaces: ``(H, W)`` indices of the visible surfaces; `NO_SURFACE` leaves a pixel unchanged.
        lights: ``(H, W)`` brightness of each pixel, as from `illuminate`.
        opacity: Weight of the new colours, in [0, 1].
        planes: ``(3, H, W)``, updated.
    """
    for j in range(surfaces.shape[0]):
        for i in range(surfaces.shape[1]):
            g = surfaces[j, i]
            if g == NO_SURFACE:
                continue
            scale = single(opacity) * _255 * lights[j, i]
            for c in range(3):
                behind = single(1.0 - opacity) * single(planes[c, j, i])
                mixed = scale * colours[g, c] + behind
                planes[c, j, i] = np.uint8(min(mixed, _255) + _HALF)


@kernel
def illuminate(
    geoms: GeomTable, view: Floats, lens: Lens, depth: Depths, surfaces: Surfaces, lights: Lights
) -> None:
    """Compute the brightness of the pixels that show primitives.

    That of polyhedra is void, see `illuminate_polyhedra`.

    Args:
        geoms: The scene's primitives.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` indices of the visible surfaces, `NO_SURFACE` for none.
        lights: ``(H, W)``, written where a primitive is visible.
    """
    if geoms.shapes.shape[0] == 0:
        return
    width = surfaces.shape[1]
    tiled, ray = -1, (_ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN)  # the last checkered primitive
    lit = -1  # the last primitive with light, and the camera and the sun in its axes
    local = local_ray(geoms.positions[0], geoms.rotations[0], view)
    sun = into_local(geoms.rotations[0], SUN[0], SUN[1], SUN[2])
    for j in range(surfaces.shape[0]):
        end = 0
        while end < width:
            first, g = end, surfaces[j, end]
            while end < width and surfaces[j, end] == g:
                end += 1
            if g == NO_SURFACE or g >= geoms.shapes.shape[0]:
                continue
            columns, run = lens.columns[first:end], depth[j, first:end]
            if g != lit:
                lit = g
                local = local_ray(geoms.positions[g], geoms.rotations[g], view)
                sun = into_local(geoms.rotations[g], SUN[0], SUN[1], SUN[2])
            # its columns, since a call with the table would count references of all of them
            shape, size = geoms.shapes[g], geoms.sizes[g]
            if shape == _BOX:
                _light_box(size, local, sun, lens.rows[j], columns, run, lights[j, first:end])
            else:
                _light_run(
                    shape, size, local, sun, lens.rows[j], columns, run, lights[j, first:end]
                )
            if geoms.checkers[g] > _0:
                if g != tiled:
                    tiled, ray = g, frame_ray(geoms, g, view)
                edge_m = geoms.checkers[g]
                tile_run(ray, lens.rows[j], columns, run, edge_m, lights[j, first:end])


@inlined
def _brightness(facing: float) -> float:
    """Return the brightness of a surface from the cosine of its angle to the sun."""
    return _AMBIENT + _DIRECT * max(facing, _0) + _BOUNCE * max(-facing, _0)


@kernel
def _light_box(
    size: Lights,
    ray: Ray,
    sun: Vector,
    y: float,
    columns: Depths,
    depth: Depths,
    lights: Lights,
) -> None:
    """Compute the brightness of a run of pixels that show one box: one of its six faces each."""
    eye, right, up, forward = ray
    start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
    front, back = _brightness(sun[0]), _brightness(-sun[0])
    left, other = _brightness(sun[1]), _brightness(-sun[1])
    top, bottom = _brightness(sun[2]), _brightness(-sun[2])
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        px = eye[0] + t * (start[0] + x * right[0])
        py = eye[1] + t * (start[1] + x * right[1])
        pz = eye[2] + t * (start[2] + x * right[2])
        ax, ay, az = abs(px) - size[0], abs(py) - size[1], abs(pz) - size[2]
        along_x = front if px > _0 else back
        along_y = left if py > _0 else other
        along_z = top if pz > _0 else bottom
        not_x = along_y if ay >= az else along_z
        lights[i] = along_x if ax >= max(ay, az) else not_x


@kernel
def _light_run(
    shape: int,
    size: Lights,
    ray: Ray,
    sun: Vector,
    y: float,
    columns: Depths,
    depth: Depths,
    lights: Lights,
) -> None:
    """Compute the brightness of a run of pixels that show one sphere, cylinder or capsule."""
    eye, right, up, forward = ray
    start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        point = (
            eye[0] + t * (start[0] + x * right[0]),
            eye[1] + t * (start[1] + x * right[1]),
            eye[2] + t * (start[2] + x * right[2]),
        )
        normal = _local_normal(shape, size, point)
        lights[i] = _brightness(normal[0] * sun[0] + normal[1] * sun[1] + normal[2] * sun[2])


@kernel
def _local_normal(shape: int, size: Lights, point: Vector) -> Vector:
    """Return the outward unit normal at a point of a round primitive, in its own axes."""
    x, y, z = point
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


@kernel
def frame_ray(geoms: GeomTable, g: int, view: Floats) -> FrameRay:
    """Return camera position, right, up and forward axes in the frame that a primitive is on."""
    rotation, local = geoms.rotations[g], geoms.local_rotations[g]
    position, offset = geoms.positions[g], geoms.offsets[g]
    x, y, z = _into_frame(
        rotation,
        local,
        view[0, 0] - position[0],
        view[0, 1] - position[1],
        view[0, 2] - position[2],
    )
    return (
        (x + offset[0], y + offset[1], z + offset[2]),
        _into_frame(rotation, local, view[1, 0], view[1, 1], view[1, 2]),
        _into_frame(rotation, local, view[2, 0], view[2, 1], view[2, 2]),
        _into_frame(rotation, local, view[3, 0], view[3, 1], view[3, 2]),
    )


@kernel
def tile_run(
    ray: FrameRay, y: float, columns: Depths, depth: Depths, edge_m: float, lights: Lights
) -> None:
    """Darken every second cell of a three-dimensional checker pattern in an object's frame."""
    per_m = 1.0 / edge_m
    (ex, ey, ez), (rx, ry, rz), (ux, uy, uz), (fx, fy, fz) = ray
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        tile = math.floor((ex + t * (fx + x * rx + y * ux)) * per_m + _TILE_SHIFT)
        tile += math.floor((ey + t * (fy + x * ry + y * uy)) * per_m + _TILE_SHIFT)
        tile += math.floor((ez + t * (fz + x * rz + y * uz)) * per_m + _TILE_SHIFT)
        if tile & 1:
            lights[i] *= single(DARK_TILE)


@kernel
def _into_frame(rotation: Floats, local: Floats, x: float, y: float, z: float) -> Point:
    """Return a world vector in the axes of the frame that a primitive is on.

    Args:
        rotation: ``(3, 3)`` from the primitive's axes to the world's.
        local: ``(3, 3)`` from the primitive's axes to the frame's.
        x: The world vector.
        y: Likewise.
        z: Likewise.
    """
    a = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    b = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    c = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    return (
        local[0, 0] * a + local[0, 1] * b + local[0, 2] * c,
        local[1, 0] * a + local[1, 1] * b + local[1, 2] * c,
        local[2, 0] * a + local[2, 1] * b + local[2, 2] * c,
    )


@kernel
def to_object_ids(objects: Surfaces, surfaces: Surfaces) -> None:
    """Replace surface indices by object ids, in place; `NO_SURFACE` is kept."""
    for j in range(surfaces.shape[0]):
        for i in range(surfaces.shape[1]):
            if surfaces[j, i] != NO_SURFACE:
                surfaces[j, i] = objects[surfaces[j, i]]


@kernel
def illuminate_polyhedra(
    geoms: GeomTable,
    view: Floats,
    lens: Lens,
    depth: Depths,
    surfaces: Surfaces,
    lights: NDArray[np.float32],
) -> None:
    """Compute the brightness of the pixels that show polyhedra; see `illuminate`.

    Args:
        geoms: The scene's primitives.
        view: ``(4, 3)`` position, right, up and forward axes of the camera, world frame.
        lens: Parameters of the camera.
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` indices of the visible surfaces, `NO_SURFACE` for none.
        lights: ``(H, W)``, written where a polyhedron is visible.
    """
    if geoms.faces.shape[0] == 0:
        return
    width = surfaces.shape[1]
    for j in range(surfaces.shape[0]):
        end = 0
        while end < width:
            first, g = end, surfaces[j, end]
            while end < width and surfaces[j, end] == g:
                end += 1
            if g == NO_SURFACE or g >= geoms.shapes.shape[0] or geoms.shapes[g] != _POLYHEDRON:
                continue
            columns, run, lit = lens.columns[first:end], depth[j, first:end], lights[j, first:end]
            _light_faces(geoms, g, view, lens.rows[j], columns, run, lit)
            if geoms.checkers[g] > 0.0:
                ray = frame_ray(geoms, g, view)
                tile_run(ray, lens.rows[j], columns, run, geoms.checkers[g], lit)


@kernel
def _light_faces(
    geoms: GeomTable,
    g: int,
    view: Floats,
    y: float,
    columns: Depths,
    depth: Depths,
    lights: NDArray[np.float32],
) -> None:
    """Compute the brightness of a run of pixels that show one polyhedron."""
    faces, size = geoms.faces, geoms.sizes[g]
    eye, right, up, forward = local_ray(geoms.positions[g], geoms.rotations[g], view)
    sun = into_local(geoms.rotations[g], SUN[0], SUN[1], SUN[2])
    start = (forward[0] + y * up[0], forward[1] + y * up[1], forward[2] + y * up[2])
    solid = float(size[0]), float(size[1]), float(size[2])
    for i in range(columns.shape[0]):
        x, t = columns[i], depth[i]
        px = eye[0] + t * (start[0] + x * right[0])
        py = eye[1] + t * (start[1] + x * right[1])
        pz = eye[2] + t * (start[2] + x * right[2])
        _, f = nearest_plane(faces, solid, px, py, pz)
        facing = faces[f, 0] * sun[0] + faces[f, 1] * sun[1] + faces[f, 2] * sun[2]
        lights[i] = AMBIENT + (1.0 - AMBIENT) * max(facing, 0.0) + BOUNCE * max(-facing, 0.0)
