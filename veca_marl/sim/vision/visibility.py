"""Whether an eye of a body sees a prop or another body."""

from __future__ import annotations

from typing import Protocol

from veca_marl.sim.body.base import Body
from veca_marl.sim.body.mounts import EYES
from veca_marl.sim.geometry.scene import Scene
from veca_marl.sim.vision.optics import Camera, seen_fraction


class Visible(Protocol):
    """What eyes can look for: a prop or a body."""

    object_id: int


def is_visible(
    scene: Scene,
    body: Body,
    thing: Visible,
    eye: str = "eye_left",
    camera: Camera | None = None,
) -> bool:
    """Say whether an eye sees a thing, also through glass (the paper's `isVisible`).

    Args:
        scene: Where both are.
        body: The body that looks; its own head and neck do not hide anything.
        thing: A prop or a body.
        eye: ``eye_left`` or ``eye_right``.
        camera: The eye's optics; None is as sharp as the default vision sense.

    Raises:
        ValueError: If there is no such eye.
    """
    if eye not in EYES:
        raise ValueError(f"no eye {eye!r}; there are {list(EYES)}")
    own_head = scene.hidden(body.object_id, body.own_head_frames)
    views = (camera or Camera()).render(scene, [body.mount(eye)], own_head)
    return seen_fraction(views, thing.object_id) > 0.0
