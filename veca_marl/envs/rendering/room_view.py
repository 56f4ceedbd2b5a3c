"""The view from outside: the room of the first actor, from an upper corner."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from veca_marl.envs.core.game import Game
from veca_marl.sim.physics.rooms import RoomCfg
from veca_marl.sim.vision import Camera, look_at


class RoomView:
    """Renders the room in which the first actor is; it never changes the game.

    Args:
        game: The game to show.
        width: Width of the images in pixels.
        height: Height of the images in pixels.
    """

    def __init__(self, game: Game, width: int, height: int) -> None:
        self._game = game
        self._camera = Camera(width, height, fov_deg=60.0)

    def image(self) -> NDArray[np.uint8]:
        """Return the room from an upper corner, ``(height, width, 3)`` uint8.

        The camera looks at the point halfway between the centre of the floor and the mean position
        of the players in this room.
        """
        room = self._room()
        low, size = np.array(room.lower_m), np.array(room.size_m)
        # inside the room, in an upper corner, where no wall hides the players
        eye = low + size * (0.04, 0.04, 0.92)
        centre = low + size * (0.5, 0.5, 0.0)
        positions = [player.body.position for player in self._game.players]
        here = [position for position in positions if room.distance_m(tuple(position[:2])) == 0.0]
        target = 0.5 * centre + 0.5 * np.mean(here or [centre], axis=0)
        views = self._camera.render(self._game.world.scene, [look_at(eye, target)])
        image: NDArray[np.uint8] = views.rgb[0].copy()
        return image

    def _room(self) -> RoomCfg:
        """Return the room nearest to the first actor: the one that it is in, if there is one."""
        place = tuple(self._game.actors[0].body.position[:2])
        return min(self._game.cfg.playground.rooms, key=lambda room: room.distance_m(place))
