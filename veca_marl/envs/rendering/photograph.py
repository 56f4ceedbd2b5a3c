"""Pictures of a scene for people: soft shadows and smooth edges, from the renderer of the eyes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.rendering.soft_shadows import (
    BLOCKER_DISC,
    SAMPLE_DISC,
    sunlit_fractions,
    tallest_nearby,
)
from veca_marl.sim.geometry import Bools, Floats, GeomTable, Pose, Scene, bounding_radius
from veca_marl.sim.vision.camera import Camera, look_at, view_axes
from veca_marl.sim.vision.contact_shadows import darken_contact_shadows
from veca_marl.sim.vision.mesh_rasterizer import draw_meshes, illuminate_triangles
from veca_marl.sim.vision.rasterizer import NO_SURFACE, Depths, Surfaces, draw_geoms
from veca_marl.sim.vision.renderer import DrawMasks, blend_layers, collect_layers
from veca_marl.sim.vision.shading import (
    AMBIENT,
    SUN,
    colour_planes,
    illuminate,
    illuminate_polyhedra,
)

Image = NDArray[np.uint8]

_SUN_AWAY_M = 60.0  # of the camera of the shadow map: its rays are nearly parallel
_SUN_FAR_M = 2.0 * _SUN_AWAY_M
_LIT_RADII_M = tuple(0.75 * 1.25**n for n in range(18))  # of what a shadow map covers
# walls that face away from the sun are dark on a projector
_EXPOSURE = np.round(255.0 * np.minimum(1.12 * np.linspace(0.0, 1.0, 256), 1.0) ** 0.85).astype(
    np.uint8
)
_LARGEST_M = 1.3  # bounding radius of the largest piece of furniture
_GRID_M = 0.25  # of its centre, so that shadows do not tremble while a camera moves


@dataclass(frozen=True)
class Quality:
    """How much a picture costs.

    Attributes:
        soft_shadows: Whether things cast soft shadows; the eyes of agents see contact shadows only.
        supersampling: Pixels that are rendered along each edge of a pixel of the picture, 1 to 4.
        map_px: Height and width of the shadow map.

    Raises:
        ValueError: If a number is outside of its range.
    """

    soft_shadows: bool = True
    supersampling: int = 2
    map_px: int = 1536

    def __post_init__(self) -> None:
        if not 1 <= self.supersampling <= 4:
            raise ValueError(f"supersampling={self.supersampling} must be 1 to 4")
        if self.map_px < 64:
            raise ValueError(f"map_px={self.map_px} must be at least 64")


def photograph(
    scene: Scene, camera: Camera, pose: Pose, quality: Quality, hidden: Bools | None = None
) -> Image:
    """Render a scene as of its last `update`, ``(H, W, 3)`` uint8.

    Args:
        scene: The scene.
        camera: Size and field of view of the picture.
        pose: x axis forward, y left, z up.
        quality: How much it costs.
        hidden: ``(S,)`` surfaces to leave out; they cast shadows all the same.
    """
    factor = quality.supersampling
    large = Camera(
        camera.width * factor, camera.height * factor, camera.fov_deg, camera.near_m, camera.far_m
    )
    image = _rendered(scene, large, pose, quality, draw_masks(scene, hidden))
    if factor > 1:
        size = (camera.width, camera.height)
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    return np.asarray(cv2.LUT(image, _EXPOSURE), np.uint8)


def _rendered(
    scene: Scene, camera: Camera, pose: Pose, quality: Quality, drawn: DrawMasks
) -> Image:
    view, lens, geoms = view_axes(pose), camera.lens, scene.geoms
    buffers = _buffers(scene, camera, view, drawn)
    lights = _lights(scene, geoms, camera, view, buffers)
    if quality.soft_shadows:
        plain = geoms._replace(checkers=np.zeros_like(geoms.checkers))
        untiled = _lights(scene, plain, camera, view, buffers)
        lights *= _shadows(scene, camera, view, quality, buffers, untiled)
    depth, surfaces, _ = buffers
    darken_contact_shadows(geoms, drawn.casting, view, lens, depth, surfaces, lights)
    planes = np.empty((3, *depth.shape), np.uint8)
    colour_planes(lens, scene.surfaces.colours, surfaces, lights, planes)
    if drawn.glass.any():
        layers = collect_layers(geoms, drawn.glass, view, lens, depth)
        blend_layers(geoms, scene.surfaces.colours, layers, view, lens, planes)
    return np.ascontiguousarray(planes.transpose(1, 2, 0))


class _Buffers(NamedTuple):
    """What a camera sees.

    Attributes:
        depth: ``(H, W)`` metres.
        surfaces: ``(H, W)`` visible surfaces.
        seen: ``(V, 3)`` vertices in the camera frame.
    """

    depth: Depths
    surfaces: Surfaces
    seen: Floats


def _buffers(scene: Scene, camera: Camera, view: Floats, drawn: DrawMasks) -> _Buffers:
    """Return depths and surfaces of the opaque things in a view."""
    depth = np.full((camera.height, camera.width), camera.far_m, np.float32)
    surfaces = np.full(depth.shape, NO_SURFACE, np.int16)
    seen = np.empty_like(scene.meshes.vertices)
    first = len(scene.geoms.shapes)
    draw_geoms(scene.geoms, drawn.opaque, view, camera.lens, True, depth, surfaces)
    draw_meshes(
        scene.meshes, drawn.triangles, view, camera.lens, True, first, seen, depth, surfaces
    )
    return _Buffers(depth, surfaces, seen)


def _lights(
    scene: Scene, geoms: GeomTable, camera: Camera, view: Floats, buffers: _Buffers
) -> Depths:
    """Return the brightness ``(H, W)`` of the pixels, without shadows."""
    depth, surfaces, seen = buffers
    lights = np.ones(depth.shape, np.float32)
    first = len(geoms.shapes)
    illuminate_triangles(scene.meshes, seen, camera.lens, first, surfaces, lights)
    illuminate(geoms, view, camera.lens, depth, surfaces, lights)
    illuminate_polyhedra(geoms, view, camera.lens, depth, surfaces, lights)
    return lights


def _shadows(
    scene: Scene,
    camera: Camera,
    view: Floats,
    quality: Quality,
    buffers: _Buffers,
    lights: Depths,
) -> Depths:
    """Return the factors ``(H, W)`` by which shadows change the brightness of the pixels.

    Args:
        scene: The scene.
        camera: The camera of the picture.
        view: Its axes.
        quality: Size of the shadow map.
        buffers: What it sees.
        lights: ``(H, W)`` brightness without checker patterns and shadows.
    """
    sun_view, sun = _sun_camera(camera, view, buffers, quality.map_px)
    # things that are hidden from the camera cast shadows all the same
    shadow_map = _buffers(scene, sun, sun_view, _casting(scene)).depth
    fractions = np.empty_like(lights)
    sunlit_fractions(
        view,
        camera.lens,
        buffers.depth,
        buffers.surfaces,
        sun_view,
        sun.lens,
        shadow_map,
        tallest_nearby(shadow_map, sun_view, sun.lens),
        (BLOCKER_DISC, SAMPLE_DISC),
        fractions,
    )
    direct = np.maximum(lights - AMBIENT, 0.0)
    shadowed = np.where(fractions < 0.0, lights, lights - direct * (1.0 - fractions))
    factors: Depths = (shadowed / lights).astype(np.float32)
    return factors


def _casting(scene: Scene) -> DrawMasks:
    """Return what casts shadows: all but walls and floors, so that no corner of a room is dark."""
    masks, geoms = draw_masks(scene), scene.geoms
    small = [
        bounding_radius(shape, size) <= _LARGEST_M
        for shape, size in zip(geoms.shapes, geoms.sizes, strict=True)
    ]
    return masks._replace(opaque=masks.opaque & np.array(small, np.bool_))


def _sun_camera(
    camera: Camera, view: Floats, buffers: _Buffers, map_px: int
) -> tuple[Floats, Camera]:
    """Return axes and camera of a shadow map that covers what a camera sees."""
    points = _visible_points(camera, view, buffers)
    low, high = np.percentile(points, (1.0, 99.0), axis=0) if len(points) else np.zeros((2, 3))
    centre = np.round((low + high) / 2.0 / _GRID_M) * _GRID_M
    needed = float(np.linalg.norm(high - low)) / 2.0 + _GRID_M
    radius = next((r for r in _LIT_RADII_M if r >= needed), _LIT_RADII_M[-1])
    fov_deg = 2.0 * math.degrees(math.atan(radius / _SUN_AWAY_M))
    pose = look_at(centre + _SUN_AWAY_M * np.array(SUN), centre)
    return view_axes(pose), Camera(map_px, map_px, fov_deg, _SUN_AWAY_M / 2.0, _SUN_FAR_M)


def _visible_points(camera: Camera, view: Floats, buffers: _Buffers) -> Floats:
    """Return some of the points that a camera sees, ``(N, 3)`` metres."""
    step = max(min(buffers.depth.shape) // 24, 1)
    depth, surfaces = (a[::step, ::step] for a in buffers[:2])
    x, y = np.meshgrid(camera.lens.columns[::step], camera.lens.rows[::step])
    rays = view[3] + x[..., None] * view[1] + y[..., None] * view[2]
    points: Floats = (view[0] + depth[..., None] * rays)[surfaces != NO_SURFACE]
    return points


def draw_masks(scene: Scene, hidden: Bools | None = None) -> DrawMasks:
    """Return which surfaces of a scene are drawn, without hidden ones.

    Raises:
        ValueError: If the mask has another length than the surfaces.
    """
    geoms, count = scene.geoms, len(scene.surfaces.objects)
    shown = np.ones(count, np.bool_) if hidden is None else ~hidden
    if shown.shape != (count,):
        raise ValueError(f"hidden has shape {shown.shape}; the scene has {count} surfaces")
    first = len(geoms.shapes)
    casting = ~geoms.transparent & shown[:first]
    glass = geoms.transparent & geoms.visible & shown[:first]
    return DrawMasks(casting & geoms.visible, glass, casting, shown[first:])
