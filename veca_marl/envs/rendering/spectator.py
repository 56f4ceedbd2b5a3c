"""Video frames of a game: the first player's eyes and skin beside a view of the room."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game import Game, Observation
from veca_marl.envs.rendering.room_view import RoomView
from veca_marl.envs.rendering.touch_image import touch_image
from veca_marl.sim.touch import TAXELS_PER_TRIANGLE

FRAME_HEIGHT = 252
ROOM_WIDTH = 336


class Spectator:
    """Renders frames for videos; it never changes the game.

    Args:
        game: The game to show.
    """

    def __init__(self, game: Game) -> None:
        self._game = game
        self._view = RoomView(game, ROOM_WIDTH, FRAME_HEIGHT)

    def room(self) -> NDArray[np.uint8]:
        """Return the room of the first actor, ``(252, 336, 3)`` uint8, see `RoomView`."""
        return self._view.image()

    def frame(self, observation: Observation) -> NDArray[np.uint8]:
        """Return one video frame: left eye, right eye, touched skin, room.

        Args:
            observation: The present observation of the first actor, as from `Game.observe`;
                senses that are not in it are left out of the frame.

        Returns:
            ``(252, width, 3)`` uint8, even width.
        """
        images = [self.room()]
        if "touch" in observation:
            images.insert(0, self._skin(observation["touch"]))
        if "vision" in observation:
            images[:0] = eye_images(observation["vision"])
        return np.concatenate(images, axis=1)

    def _skin(self, touch: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the body of the first actor, coloured by its touch readings."""
        scene = self._game.world.scene
        body = scene.objects[self._game.actors[0].body.object_id]
        readings = touch.reshape(-1, TAXELS_PER_TRIANGLE).astype(np.float64)
        return touch_image(scene, body, readings, FRAME_HEIGHT)


def eye_images(vision: NDArray[Any]) -> list[NDArray[np.uint8]]:
    """Enlarge ``(2, 3, H, W)`` uint8 to two images ``(252, width, 3)`` by nearest neighbours."""
    images: list[NDArray[np.uint8]] = []
    for eye in vision:
        image = np.ascontiguousarray(np.moveaxis(eye, 0, -1))
        width = round(FRAME_HEIGHT * image.shape[1] / image.shape[0] / 2) * 2
        size = (width, FRAME_HEIGHT)
        images.append(np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_NEAREST)))
    return images
