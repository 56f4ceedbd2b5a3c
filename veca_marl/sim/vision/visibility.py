"""Images and visibility on request, independent of the sense of vision of a body."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.body import Body
from veca_marl.sim.body.sense_organs import EYES, Visible
from veca_marl.sim.geometry import Pose, Scene
from veca_marl.sim.vision.camera import Camera
from veca_marl.sim.vision.vision_sense import EyeViews, VisionCfg


def is_visible(
    scene: Scene,
    body: Body,
    target: Visible,
    eyes: Sequence[str] = EYES,
    camera: Camera | None = None,
) -> bool:
    """Return whether a body sees a prop or body, also through glass (the paper's `isVisible`).

    Every call renders the images. `VisionSense.eyes.is_visible` uses those of the observation.

    Args:
        scene: The scene of both, as of its last `update`.
        body: The body that looks; its own head and neck hide nothing.
        target: A prop or a body.
        eyes: The open eyes: ``eye_left``, ``eye_right`` or both.
        camera: The camera of either eye; None is that of `VisionCfg` with its defaults.

    Raises:
        ValueError: If there is no such eye.
    """
    camera = default_camera() if camera is None else camera
    return EyeViews(scene, body, camera, eyes).is_visible(target.object_id)


def open_eyes(scene: Scene, body: Body, camera: Camera | None = None) -> EyeViews:
    """Give a body its sight: both eyes open. `make_senses` does so for the bodies of a game.

    Args:
        scene: The scene of the body.
        body: The body.
        camera: The camera of either eye; None is that of `VisionCfg` with its defaults.
    """
    eyes = EyeViews(scene, body, default_camera() if camera is None else camera)
    body.sight = eyes
    return eyes


def get_image(
    scene: Scene,
    camera: Pose,
    height: int,
    width: int,
    grayscale: bool = False,
    *,
    owner: Body | None = None,
    fov_deg: float = VisionCfg.fov_deg,
) -> NDArray[np.uint8]:
    """Render the image of a camera (the paper's `getImage`).

    Args:
        scene: The scene, as of its last `update`.
        camera: Pose of the camera, which looks along its x axis, such as `Body.mount("eye_left")`.
        height: Pixels.
        width: Pixels.
        grayscale: Whether to return luma (ITU-R BT.601) in place of red, green and blue.
        owner: The body to which the camera belongs; its head and neck are not shown.
        fov_deg: Vertical field of view.

    Returns:
        ``(height, width, 3)`` uint8 RGB, or ``(height, width)``.

    Raises:
        ValueError: If the size or the field of view is outside of its range, see `Camera`.
    """
    hidden = None if owner is None else scene.hidden(owner.object_id, owner.own_head_frames)
    image = Camera(width, height, fov_deg).render(scene, [camera], hidden).rgb[0]
    grey: NDArray[np.uint8] = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if grayscale else image
    return grey


@cache
def default_camera() -> Camera:
    """Return the camera of `VisionCfg` with its defaults; checking them at every call costs."""
    return VisionCfg().camera()
