"""A pinhole camera that sees a `Scene`: colours, depths and who is where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from veca_marl.sim.contact_shadows import darken_contacts
from veca_marl.sim.pose import Floats, Pose
from veca_marl.sim.raster import NOTHING, Depths, Lens, Surfaces, draw_geoms
from veca_marl.sim.scene import Bools, Scene
from veca_marl.sim.screen_bounds import single
from veca_marl.sim.shading import (
    GLASS_OPACITY,
    Images,
    Lights,
    illuminate,
    name_objects,
    paint,
    paint_sky,
)
from veca_marl.sim.skins_in_view import draw_skins
from veca_marl.sim.triangles import illuminate_triangles


class Views(NamedTuple):
    """What a camera saw from V poses.

    Attributes:
        rgb: ``(V, H, W, 3)`` uint8.
        depth: ``(V, H, W)`` float32 metres along the optical axis to what is not transparent; the
            camera's `far_m` where there is nothing.
        ids: ``(V, H, W)`` int16 id of the object seen, through transparent ones; -1 for the sky.
        glass_ids: ``(V, H, W)`` int16 id of the nearest transparent object in front, or -1.
    """

    rgb: Images
    depth: Depths
    ids: Surfaces
    glass_ids: Surfaces


@dataclass(frozen=True)
class Camera:
    """A pinhole camera looking along the x axis of its pose, with the z axis up.

    Attributes:
        width: Pixels.
        height: Pixels.
        fov_deg: Vertical field of view, as in OpenGL and PyBullet; pixels are square.
        near_m: Nothing nearer is drawn.
        far_m: Nothing farther is drawn.

    Raises:
        ValueError: If a number is not possible.
    """

    width: int = 84
    height: int = 84
    fov_deg: float = 60.0
    near_m: float = 0.01
    far_m: float = 100.0
    lens: Lens = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a camera of {self.width}x{self.height} pixels: want at least 1x1")
        if not 0.0 < self.fov_deg < 170.0:
            raise ValueError(f"fov_deg {self.fov_deg}: want degrees between 0 and 170")
        if not 0.0 < self.near_m < self.far_m < np.inf:
            raise ValueError(f"near_m {self.near_m}, far_m {self.far_m}: want 0 < near < far")
        object.__setattr__(self, "lens", self._lens())

    def _lens(self) -> Lens:
        tan_y = math.tan(math.radians(self.fov_deg) / 2.0)
        tan_x = tan_y * self.width / self.height
        columns = ((np.arange(self.width) + 0.5) / self.width * 2.0 - 1.0) * tan_x
        rows = (1.0 - (np.arange(self.height) + 0.5) / self.height * 2.0) * tan_y
        return Lens(
            columns.astype(np.float32),
            rows.astype(np.float32),
            single(tan_x),
            single(tan_y),
            single(self.near_m),
            single(self.far_m),
        )

    @property
    def degrees_per_pixel(self) -> float:
        """Angle that one pixel covers at the centre of the picture."""
        return math.degrees(2.0 * self.lens.tan_y / self.height)

    def project(self, pose: Pose, points: Floats) -> Floats:
        """Return where world points fall in the picture.

        Args:
            pose: Of the camera.
            points: ``(N, 3)`` metres, world frame.

        Returns:
            ``(N, 3)``: column and row in pixels (0.5 is the middle of the first one) and depth in
            metres; column and row mean nothing where the depth is not positive.
        """
        forward, left, up = ((points - pose.position) @ pose.rotation).T
        tan_x, tan_y = self.lens.tan_x, self.lens.tan_y
        column = (1.0 - left / forward / tan_x) * self.width / 2.0
        row = (1.0 - up / forward / tan_y) * self.height / 2.0
        return np.stack([column, row, forward], axis=1)

    def render(self, scene: Scene, poses: Sequence[Pose], hidden: Bools | None = None) -> Views:
        """Return what the camera sees of a scene from some poses, as of `Scene.update`.

        Args:
            scene: The world.
            poses: One per view: x axis forward, y left, z up.
            hidden: ``(S,)`` surfaces to leave out, as from `Scene.hidden`.
        """
        views = self._blank(len(poses))
        lights = np.empty((self.height, self.width), np.float32)
        drawn = _drawn(scene, hidden)
        geoms, lens, (colours, objects, _) = scene.geoms, self.lens, scene.surfaces
        for v, pose in enumerate(poses):
            view = view_axes(pose)
            rgb, depth, ids, glass_ids = (array[v] for array in views)
            draw_geoms(geoms, drawn.opaque, view, lens, True, depth, ids)
            self._draw_skins(scene, drawn.triangles, view, depth, ids, lights)
            illuminate(geoms, view, lens, depth, ids, lights)
            darken_contacts(geoms, drawn.casting, view, lens, depth, ids, lights)
            paint_sky(lens, rgb)
            paint(colours, ids, lights, 1.0, rgb)
            name_objects(objects, ids)
            if drawn.glass.any():
                glass_depth = depth.copy()
                draw_geoms(geoms, drawn.glass, view, lens, True, glass_depth, glass_ids)
                illuminate(geoms, view, lens, glass_depth, glass_ids, lights)
                paint(colours, glass_ids, lights, GLASS_OPACITY, rgb)
                name_objects(objects, glass_ids)
        return views

    def _draw_skins(
        self,
        scene: Scene,
        drawn: Bools,
        view: Floats,
        depth: Depths,
        surfaces: Surfaces,
        lights: Lights,
    ) -> None:
        """Draw and light the triangles of one view."""
        meshes, first = scene.meshes, len(scene.geoms.shapes)
        if not len(meshes.triangles):
            return
        seen = np.empty_like(meshes.vertices)
        draw_skins(meshes, drawn, view, self.lens, True, first, seen, depth, surfaces)
        illuminate_triangles(meshes, seen, self.lens, first, surfaces, lights)

    def _blank(self, count: int) -> Views:
        """Buffers in which nothing is seen yet."""
        size = (count, self.height, self.width)
        return Views(
            np.empty((*size, 3), np.uint8),
            np.full(size, self.lens.far, np.float32),
            np.full(size, NOTHING, np.int16),
            np.full(size, NOTHING, np.int16),
        )


def view_axes(pose: Pose) -> Floats:
    """Return ``(4, 3)``: position, right, up and forward axes of an eye, as the renderer wants."""
    forward, left, up = pose.rotation.T
    return np.stack([pose.position, -left, up, forward], dtype=np.float64)


def look_at(position: Floats, target: Floats) -> Pose:
    """Return the pose of a camera at `position` that looks at `target` with a level horizon.

    Raises:
        ValueError: If the target is the position, or straight above or below it.
    """
    way = np.asarray(target, np.float64) - position
    left = np.array([-way[1], way[0], 0.0])
    if not np.linalg.norm(left) > 1e-9:
        raise ValueError(f"cannot look level from {position} at {target}")
    forward, left = way / np.linalg.norm(way), left / np.linalg.norm(left)
    return Pose(
        np.asarray(position, np.float64), np.stack([forward, left, np.cross(forward, left)], 1)
    )


def seen_fraction(views: Views, object_id: int) -> float:
    """Return the share of all pixels that show an object, be it through glass or as glass."""
    return float(np.mean((views.ids == object_id) | (views.glass_ids == object_id)))


class _Drawn(NamedTuple):
    """Masks of what is drawn and how.

    Attributes:
        opaque: ``(G,)`` primitives that hide what is behind them.
        glass: ``(G,)`` primitives that do not.
        casting: ``(G,)`` primitives that cast shadows: bones do so for the skin on them.
        triangles: ``(T,)`` triangles.
    """

    opaque: Bools
    glass: Bools
    casting: Bools
    triangles: Bools


def _drawn(scene: Scene, hidden: Bools | None) -> _Drawn:
    """Sort out what is drawn and how."""
    geoms, count = scene.geoms, len(scene.surfaces.objects)
    shown = np.ones(count, np.bool_) if hidden is None else ~hidden
    if shown.shape != (count,):
        raise ValueError(f"hidden has shape {shown.shape}; the scene has {count} surfaces")
    first = len(geoms.shapes)
    casting = ~geoms.transparent & shown[:first]
    glass = geoms.transparent & geoms.visible & shown[:first]
    return _Drawn(casting & geoms.visible, glass, casting, shown[first:])
