"""Whether the eyes of a body see a prop or another body, independent of its sense of vision."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from veca_marl.sim.body import Body
from veca_marl.sim.body.mounts import EYES
from veca_marl.sim.body.sight import Visible
from veca_marl.sim.geometry import Scene
from veca_marl.sim.vision.eye_views import EyeViews
from veca_marl.sim.vision.optics import Camera
from veca_marl.sim.vision.vision_cfg import VisionCfg


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


@cache
def default_camera() -> Camera:
    """Return the camera of `VisionCfg` with its defaults; checking them at every call costs."""
    return VisionCfg().camera()
