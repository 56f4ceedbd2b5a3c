"""What the eyes of a body see, rendered once per state of the scene and the eyes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from veca_marl.sim.body import Body
from veca_marl.sim.body.mounts import EYES
from veca_marl.sim.geometry import Bools, Floats, Scene
from veca_marl.sim.vision.camera import Camera, seen_fraction
from veca_marl.sim.vision.rasterization.rendering import Views


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
        rows, columns = np.indices((camera.height, camera.width)) + 0.5
        self._off_centre_px: Floats = np.hypot(
            rows - camera.height / 2.0, columns - camera.width / 2.0
        ).ravel()

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

    def is_visible(self, object_id: int, eye: str | None = None) -> bool:
        """Return whether a pixel shows an object, also through transparent ones.

        Args:
            object_id: Its id in the scene.
            eye: One of the open eyes; None is any of them.

        Raises:
            ValueError: If this is not an open eye.
        """
        views = self.views() if eye is None else self._view_of(eye)
        return seen_fraction(views, object_id) > 0.0

    def front_objects(self) -> dict[int, float]:
        """Return the ids of all objects that are the foremost ones in at least one pixel.

        Objects that are seen only through transparent ones are left out.

        Returns:
            The smallest distance from the centre of an image for each, in pixels.
        """
        views = self.views()
        front = views.ids
        if len(views.glass_ids):
            nearest = views.glass_ids[0]
            front = np.where(nearest >= 0, nearest, front)
        distances = np.full(int(front.max()) + 2, np.inf)  # the last one is that of the sky, -1
        np.minimum.at(distances, front.ravel(), np.tile(self._off_centre_px, len(front)))
        return {number: float(d) for number, d in enumerate(distances[:-1]) if d < np.inf}

    def _view_of(self, eye: str) -> Views:
        """Return the images with that of one eye only."""
        if eye not in self._mounts:
            raise ValueError(f"no open eye {eye!r}; choices: {list(self._mounts)}")
        chosen = slice(index := self._mounts.index(eye), index + 1)
        rgb, depth, ids, glass_ids = self.views()
        return Views(rgb[chosen], depth[chosen], ids[chosen], glass_ids[:, chosen])

    def _own_head_mask(self) -> Bools:
        """Return the mask of the surfaces of the own head, recomputed when the scene has grown."""
        if len(self._hidden) != len(self._scene.surfaces.objects):
            self._hidden = self._scene.hidden(self._body.object_id, self._body.own_head_frames)
        return self._hidden
