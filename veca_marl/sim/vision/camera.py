"""A pinhole camera that renders a `Scene`: colours, depths and object ids."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import NamedTuple

import numpy as np

from veca_marl.sim.geometry import Bools, Floats, Pose, Scene, SceneObject, single
from veca_marl.sim.vision.mesh_rasterizer import (
    draw_triangles,
    illuminate_triangles,
    to_camera_frame,
)
from veca_marl.sim.vision.rasterizer import NO_SURFACE, Depths, Lens, Surfaces
from veca_marl.sim.vision.renderer import DrawMasks, Views, render_views


class MeshView(NamedTuple):
    """The image of one mesh without colours.

    Attributes:
        visible: ``(H, W)`` which pixels show it; the others of `triangles` and `lights` are void.
        triangles: ``(H, W)`` int16 index of the triangle among those of the mesh.
        depth: ``(H, W)`` float32 metres along the optical axis; `Camera.far_m` elsewhere.
        lights: ``(H, W)`` float32 brightness.
    """

    visible: Bools
    triangles: Surfaces
    depth: Depths
    lights: Depths


_MOST_PIXELS = 8192  # of a row or column; more is a slip, and fills the memory


@dataclass(frozen=True)
class Camera:
    """A pinhole camera looking along the x axis of its pose, with the z axis up.

    Attributes:
        width: Pixels.
        height: Pixels.
        fov_deg: Vertical field of view, as in OpenGL and PyBullet; pixels are square.
        near_m: Near plane. Small, since an eye in contact with a wall would see through it.
        far_m: Far plane.

    Raises:
        ValueError: If a number is outside of its range.
    """

    width: int = 84
    height: int = 84
    fov_deg: float = 60.0
    near_m: float = 0.001
    far_m: float = 100.0
    lens: Lens = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        whole = isinstance(self.width, Integral) and isinstance(self.height, Integral)
        if not whole or not (1 <= self.width <= _MOST_PIXELS and 1 <= self.height <= _MOST_PIXELS):
            raise ValueError(
                f"width x height {self.width}x{self.height} must be whole numbers, "
                f"at least 1x1 and at most {_MOST_PIXELS}x{_MOST_PIXELS}"
            )
        if not 0.0 < self.fov_deg < 170.0:
            raise ValueError(f"fov_deg {self.fov_deg} must be between 0 and 170")
        if not 0.0 < self.near_m < self.far_m < np.inf:
            raise ValueError(f"near_m {self.near_m}, far_m {self.far_m}: must be 0 < near < far")
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
        """Visual angle of a pixel at the centre of the image."""
        return math.degrees(2.0 * self.lens.tan_y / self.height)

    def project(self, pose: Pose, points: Floats) -> Floats:
        """Project world points to the image.

        Args:
            pose: Pose of the camera.
            points: ``(N, 3)`` metres, world frame.

        Returns:
            ``(N, 3)``: column and row in pixels (0.5 is the middle of the first one) and depth in
            metres; column and row are undefined where the depth is not positive.
        """
        forward, left, up = ((points - pose.position) @ pose.rotation).T
        tan_x, tan_y = self.lens.tan_x, self.lens.tan_y
        column = (1.0 - left / forward / tan_x) * self.width / 2.0
        row = (1.0 - up / forward / tan_y) * self.height / 2.0
        return np.stack([column, row, forward], axis=1)

    def render(self, scene: Scene, poses: Sequence[Pose], hidden: Bools | None = None) -> Views:
        """Render a scene from some poses, as of its last `update`.

        Args:
            scene: The scene.
            poses: One per view: x axis forward, y left, z up.
            hidden: ``(S,)`` mask of surfaces to leave out, as from `Scene.hidden`.
        """
        views = self._blank(len(poses))
        axes = np.array([view_axes(pose) for pose in poses])
        drawn = _drawn(scene, hidden)
        tables = scene.geoms, scene.meshes, scene.surfaces
        glass_ids = render_views(*tables, drawn, axes, self.lens, views)
        return views._replace(glass_ids=glass_ids)

    def render_mesh(self, scene: Scene, item: SceneObject, pose: Pose) -> MeshView:
        """Render the mesh of one object alone, as of the last `Scene.update`.

        Args:
            scene: The scene.
            item: An object of it with a mesh.
            pose: x axis forward, y left, z up.
        """
        meshes = scene.meshes
        in_camera = np.empty_like(meshes.vertices)
        to_camera_frame(meshes.vertices, view_axes(pose), in_camera)
        depth = np.full((self.height, self.width), self.far_m, np.float32)
        surfaces = np.full(depth.shape, NO_SURFACE, np.int16)
        lights = np.zeros(depth.shape, np.float32)
        drawn = np.zeros(len(meshes.triangles), np.bool_)
        drawn[item.triangles] = True
        draw_triangles(meshes.triangles, in_camera, drawn, self.lens, 0, depth, surfaces)
        illuminate_triangles(meshes, in_camera, self.lens, 0, surfaces, lights)
        return MeshView(surfaces != NO_SURFACE, surfaces - item.triangles.start, depth, lights)

    def _blank(self, count: int) -> Views:
        """Return uninitialised buffers for a number of views."""
        size = (count, self.height, self.width)
        return Views(
            np.empty((count, 3, self.height, self.width), np.uint8),
            np.empty(size, np.float32),
            np.empty(size, np.int16),
            np.empty((0, *size), np.int16),
        )


def view_axes(pose: Pose) -> Floats:
    """Return ``(4, 3)``: position, right, up and forward axes of a camera pose, world frame."""
    forward, left, up = pose.rotation.T
    axes = np.empty((4, 3))
    axes[0], axes[1], axes[2], axes[3] = pose.position, -left, up, forward
    return axes


def look_at(position: Floats, target: Floats) -> Pose:
    """Return the pose of a camera at `position` that looks at `target` with a level horizon.

    Raises:
        ValueError: If the target is the position, or straight above or below it.
    """
    way = np.asarray(target, np.float64) - position
    left = np.array([-way[1], way[0], 0.0])
    if not np.linalg.norm(left) > 1e-9:
        raise ValueError(f"no level camera at {position} can look at {target}")
    forward, left = way / np.linalg.norm(way), left / np.linalg.norm(left)
    return Pose(
        np.asarray(position, np.float64), np.stack([forward, left, np.cross(forward, left)], 1)
    )


def seen_fraction(views: Views, object_id: int) -> float:
    """Return the fraction of pixels that show an object, also through or as a transparent one."""
    shown = views.ids == object_id
    for layer in views.glass_ids:
        shown |= layer == object_id
    return float(np.mean(shown))


def _drawn(scene: Scene, hidden: Bools | None) -> DrawMasks:
    """Return the masks of a scene without its hidden surfaces."""
    geoms, count = scene.geoms, len(scene.surfaces.objects)
    shown = np.ones(count, np.bool_) if hidden is None else ~hidden
    if shown.shape != (count,):
        raise ValueError(f"hidden has shape {shown.shape}; the scene has {count} surfaces")
    first = len(geoms.shapes)
    opaque = ~geoms.transparent & shown[:first]
    glass = geoms.transparent & geoms.visible & shown[:first]
    return DrawMasks(opaque & geoms.visible, glass, opaque & geoms.tangible, shown[first:])
