"""Whether an eye of a body sees a prop or another body, independent of its sense of vision."""

from __future__ import annotations

from functools import cache
from typing import Protocol

from veca_marl.sim.body import Body
from veca_marl.sim.body.mounts import EYES
from veca_marl.sim.geometry import Scene
from veca_marl.sim.vision.optics import Camera, seen_fraction
from veca_marl.sim.vision.sense import VisionCfg


class Visible(Protocol):
    """What `is_visible` can look for: a prop or a body.

    Attributes:
        object_id: Its id in the scene.
    """

    object_id: int


def is_visible(
    scene: Scene,
    body: Body,
    target: Visible,
    eye: str = "eye_left",
    camera: Camera | None = None,
) -> bool:
    """Return whether an eye sees a prop or body, also through glass (the paper's `isVisible`).

    Args:
        scene: The scene of both, as of its last `update`.
        body: The body whose eye it is; its own head and neck hide nothing.
        target: A prop or a body.
        eye: ``eye_left`` or ``eye_right``.
        camera: The camera of the eye; None is that of `VisionCfg` with its defaults.

    Raises:
        ValueError: If there is no such eye.
    """
    if eye not in EYES:
        raise ValueError(f"no eye {eye!r}; choices: {list(EYES)}")
    own_head = scene.hidden(body.object_id, body.own_head_frames)
    camera = _default_camera() if camera is None else camera
    views = camera.render(scene, [body.mount(eye)], own_head)
    return seen_fraction(views, target.object_id) > 0.0


@cache
def _default_camera() -> Camera:
    """Return the camera of `VisionCfg` with its defaults; checking them at every call costs."""
    return VisionCfg().camera()
