"""What a person watching a game sees: the player's eyes and skin beside a view of the room."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.rendering.touch_picture import picture_of_touch
from veca_marl.sim.touch.taxels import TAXELS_PER_TRIANGLE
from veca_marl.sim.vision.optics import Camera, look_at

FRAME_HEIGHT = 252
ROOM_WIDTH = 336


class Spectator:
    """Draws frames for videos; it never changes the game.

    Args:
        game: Whom to watch.
    """

    def __init__(self, game: Game) -> None:
        self._game = game
        self._camera = Camera(ROOM_WIDTH, FRAME_HEIGHT, fov_deg=60.0)
        room = game.cfg.playground.rooms[0]
        low, size = np.array(room.lower_m), np.array(room.size_m)
        self._centre = low + size * (0.5, 0.5, 0.0)
        # from inside the room, in the upper corner: no wall stands in the way
        self._eye = low + size * (0.04, 0.04, 0.92)

    def room(self) -> NDArray[np.uint8]:
        """Return the room from above one corner, ``(252, 336, 3)`` uint8."""
        players = [player.body.position for player in self._game.players]
        target = 0.5 * self._centre + 0.5 * np.mean(players, axis=0)
        pose = look_at(self._eye, target)
        return self._camera.render(self._game.world.scene, [pose]).rgb[0].copy()

    def frame(self, observation: Observation) -> NDArray[np.uint8]:
        """Return one video frame: left eye, right eye, touched skin, room.

        Args:
            observation: What the first actor observes now, as from `Game.observe`; a sense that
                is not in it is not shown.

        Returns:
            ``(252, width, 3)`` uint8, even width.
        """
        pictures = [self.room()]
        if "touch" in observation:
            pictures.insert(0, self._skin(observation["touch"]))
        if "vision" in observation:
            pictures[:0] = eye_images(observation["vision"])
        return np.concatenate(pictures, axis=1)

    def _skin(self, touch: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the first player's body, coloured where it feels something."""
        scene = self._game.world.scene
        body = scene.objects[self._game.actors[0].body.object_id]
        readings = touch.reshape(-1, TAXELS_PER_TRIANGLE).astype(np.float64)
        return picture_of_touch(scene, body, readings, FRAME_HEIGHT)


def eye_images(vision: NDArray[Any]) -> list[NDArray[np.uint8]]:
    """Enlarge ``(2, 3, H, W)`` to two images ``(252, width, 3)``, pixels kept visible."""
    images = []
    for eye in vision:
        image = np.ascontiguousarray(np.moveaxis(eye, 0, -1))
        width = round(FRAME_HEIGHT * image.shape[1] / image.shape[0] / 2) * 2
        images.append(cv2.resize(image, (width, FRAME_HEIGHT), interpolation=cv2.INTER_NEAREST))
    return images
