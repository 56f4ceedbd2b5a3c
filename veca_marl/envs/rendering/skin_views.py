"""Images and video frames of a game for people: eyes, skin, the room, tactile lines."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose, Scene, SceneObject
from veca_marl.sim.touch import TAXELS_PER_TRIANGLE, load_taxels, taxel_positions
from veca_marl.sim.touch.parts import skin_parts
from veca_marl.sim.vision import Camera

PALE = (0.86, 0.86, 0.84)
BACKGROUND = (0.13, 0.14, 0.17)
# colours of readings 0, 0.5 and 1
_SCALE = np.array([(0.98, 0.93, 0.35), (0.98, 0.55, 0.10), (0.85, 0.05, 0.10)])
_DISTANCE_M, _RAISED_M, _FOV_DEG = 1.5, 0.35, 36.0


def touch_image(
    scene: Scene, body: SceneObject, readings: Floats, height: int = 252
) -> NDArray[np.uint8]:
    """Render front and back of a body with an upright pelvis, its taxels in contact coloured.

    Args:
        scene: The scene, as of its last `update`.
        body: The body.
        readings: ``(1648, 6)`` in [0, 1], as from `TouchSense.update_taxels`.
        height: Height of the image in pixels.

    Returns:
        ``(height, 2 * width, 3)`` uint8, with a width of 2/3 of the height.

    Raises:
        ValueError: If the body has no skin, or the readings have another shape than its taxels.
    """
    triangles = body.triangles.stop - body.triangles.start
    if readings.shape != load_taxels().depths.shape or triangles != len(readings):
        raise ValueError(
            f"{body.name} has {triangles} triangles, the readings have shape {readings.shape}: "
            f"must be {load_taxels().depths.shape}"
        )
    camera = Camera(max(height * 2 // 3, 1), height, _FOV_DEG)
    return np.concatenate(
        [_portrait(scene, body, readings, camera, pose) for pose in _viewpoints(body)], axis=1
    )


def touch_readings(observation: Mapping[str, NDArray[Any]]) -> Floats | None:
    """Return the readings of all taxels, ``(1648, 6)`` in [0, 1]; None without touch.

    With `touch_parts` only, every taxel of a part has the greatest reading of the part.
    """
    if "touch" in observation:
        return observation["touch"].reshape(-1, TAXELS_PER_TRIANGLE).astype(np.float64)
    if "touch_parts" not in observation:
        return None
    readings = np.zeros(load_taxels().depths.shape)
    parts = skin_parts()
    maxima = observation["touch_parts"][len(parts) :]
    for part, reading in zip(parts, maxima, strict=True):
        readings[part.triangles] = reading
    return readings


def save_touch_image(
    path: str | Path, scene: Scene, body: SceneObject, readings: Floats, height: int = 504
) -> None:
    """Write `touch_image` as a PNG file.

    Raises:
        OSError: If the file cannot be written.
    """
    image = touch_image(scene, body, readings, height)
    if not cv2.imwrite(str(path), image[..., ::-1]):
        raise OSError(f"cannot write {path}")


def _viewpoints(body: SceneObject) -> list[Pose]:
    """Return poses in front of and behind the pelvis, somewhat towards the head."""
    centre = body.positions.mean(axis=0)
    ahead, _, up = body.rotations[0].T
    return [_upright(_DISTANCE_M * way + _RAISED_M * up, centre, up) for way in (ahead, -ahead)]


def _upright(offset: Floats, centre: Floats, up: Floats) -> Pose:
    """Return the pose of a camera that looks at a point, with `up` upwards in the image."""
    forward = -offset / np.linalg.norm(offset)
    above = up - up.dot(forward) * forward
    above /= np.linalg.norm(above)
    return Pose(centre + offset, np.stack([forward, np.cross(above, forward), above], axis=1))


def _portrait(
    scene: Scene, body: SceneObject, readings: Floats, camera: Camera, pose: Pose
) -> NDArray[np.uint8]:
    """Render the body in pale grey, with taxels in contact in the colours of their readings."""
    view = camera.render_mesh(scene, body, pose)
    colours = np.where(view.visible[..., None], view.lights[..., None] * np.array(PALE), BACKGROUND)
    points = pose.position + view.depth[..., None] * _rays(camera, pose)
    taxels, _ = taxel_positions(load_taxels(), scene.meshes.vertices[body.vertices])
    own = view.visible
    felt = _nearest(points[own], view.triangles[own], taxels, readings)
    touched = felt > 0.0
    marks = np.stack([np.interp(felt[touched], (0.0, 0.5, 1.0), c) for c in _SCALE.T], axis=1)
    shades = colours[own]
    shades[touched] = marks
    colours[own] = shades
    image: NDArray[np.uint8] = np.round(255.0 * colours.clip(0.0, 1.0)).astype(np.uint8)
    return image


def _rays(camera: Camera, pose: Pose) -> Floats:
    """Return the vectors ``(H, W, 3)`` along the rays per metre of depth, world frame."""
    x, y = np.meshgrid(camera.lens.columns, camera.lens.rows)
    rays: Floats = np.stack([np.ones_like(x), -x, y], axis=-1) @ pose.rotation.T
    return rays


def _nearest(
    points: Floats, triangles: NDArray[np.int16], taxels: Floats, readings: Floats
) -> Floats:
    """Return the reading ``(N,)`` of the nearest of the six taxels of each point's triangle."""
    away = np.linalg.norm(points[:, None] - taxels[triangles], axis=2)
    felt: Floats = readings[triangles, away.argmin(axis=1)]
    return felt


BLUE = (40, 90, 255)


def draw_tactile_lines(
    image: NDArray[np.uint8], camera: Camera, pose: Pose, lines: Floats
) -> NDArray[np.uint8]:
    """Return an image with lines in blue; they are not hidden by what is in front of them.

    Args:
        image: ``(H, W, 3)`` uint8 RGB, as rendered by the camera.
        camera: The camera.
        pose: Its pose.
        lines: ``(n, 2, 3)`` metres, as from `get_tactile` with `debug`.

    Raises:
        ValueError: If the image has not the size of the camera's.
    """
    if image.shape != (camera.height, camera.width, 3):
        raise ValueError(f"image {image.shape}, not {(camera.height, camera.width, 3)}")
    drawn = np.ascontiguousarray(image).copy()
    ends = camera.project(pose, lines.reshape(-1, 3)).reshape(-1, 2, 3)
    for start, end in ends[(ends[..., 2] > camera.near_m).all(axis=1)]:
        first, last = np.floor(start[:2]).astype(int), np.floor(end[:2]).astype(int)
        cv2.line(drawn, first.tolist(), last.tolist(), BLUE)
    return drawn
