"""What the eyes of a body see, rendered once per state of the scene and the eyes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.sim.body import Body
from veca_marl.sim.body.mounts import EYES
from veca_marl.sim.geometry import Bools, Scene
from veca_marl.sim.vision.optics import Camera, seen_fraction
from veca_marl.sim.vision.rendering import Views


class EyeViews:
    """The images of the open eyes of one body, before any filter.

    Rendering is lazy and happens once per state of the scene and the eyes, so that the sense of
    vision and tasks that ask for visibility share it.

    Args:
        scene: The scene of the body.
        body: Its own head and neck hide nothing.
        camera: The camera of either eye.
        mounts: The open eyes, of `EYES`.

    Attributes:
        camera: The camera of either eye.

    Raises:
        ValueError: If there is no such eye, or none is open.
    """

    def __init__(
        self, scene: Scene, body: Body, camera: Camera, mounts: Sequence[str] = EYES
    ) -> None:
        if not mounts or not set(mounts) <= set(EYES):
            raise ValueError(f"no eyes {list(mounts)}; choices: {list(EYES)}")
        self.camera = camera
        self._scene, self._body = scene, body
        self._mounts = tuple(mounts)
        self._hidden: Bools = np.zeros(0, np.bool_)
        self._seen: tuple[bytes, Views] | None = None

    def views(self) -> Views:
        """Return the present images, one per open eye; do not write into them."""
        poses = [self._body.mount(name) for name in self._mounts]
        state = self._scene.version.to_bytes(8) + b"".join(
            array.tobytes() for pose in poses for array in pose
        )
        if self._seen is None or self._seen[0] != state:
            self._seen = state, self.camera.render(self._scene, poses, self._own_head_mask())
        return self._seen[1]

    def seen_fraction(self, object_id: int) -> float:
        """Return the fraction of all pixels that show an object, also through transparent ones."""
        return seen_fraction(self.views(), object_id)

    def is_visible(self, object_id: int) -> bool:
        """Return whether a pixel of an open eye shows an object, also through transparent ones."""
        return self.seen_fraction(object_id) > 0.0

    def _own_head_mask(self) -> Bools:
        """Return the mask of the surfaces of the own head, recomputed when the scene has grown."""
        if len(self._hidden) != len(self._scene.surfaces.objects):
            self._hidden = self._scene.hidden(self._body.object_id, self._body.own_head_frames)
        return self._hidden
