"""What the simulator knows of a game, as one vector: what a central critic may read in training.

Actors never read it. Names of its parts, with their lengths::

    time                      1    elapsed share of the episode
    PLAYER.NAME               ...  `Body.state`: pose, motion, joints, gaze and voice
    PLAYER.present            1    0 if it is eliminated
    PROP.position             3    each prop that can move or that the task added
    PROP.forward, .up         3+3  unit vectors of its frame
    PROP.velocity, .spin      3+3  if it can move
    PROP.colour               3    RGB in [0, 1] of its first shape
    PROP.sounding             1    if it has a sound that is not muted
    task.NAME                 1    `Task.state`: numbers of the task that no pose shows
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from veca_marl.envs.core.game import Game
from veca_marl.sim.physics import Prop


class GlobalState:
    """Reads the state of one game.

    Args:
        game: The game.

    Attributes:
        parts: Name of each part to its place in the vector.
        size: Length of the vector.
    """

    def __init__(self, game: Game) -> None:
        self._game = game
        self._built = {cfg.name for cfg in game.cfg.playground.built_props()}
        self.parts: dict[str, slice] = {}
        self.size = 0
        for name, numbers in self._read():
            length = np.size(numbers)
            self.parts[name] = slice(self.size, self.size + length)
            self.size += length

    def read(self) -> NDArray[np.float32]:
        """Return the state at this moment, ``(size,)`` float32.

        After a step that ends the episode because the simulation is not finite any more, numbers
        that are not finite are 0.
        """
        state = np.concatenate([np.ravel(part) for _, part in self._read()], dtype=np.float32)
        return np.nan_to_num(state, copy=False, posinf=0.0, neginf=0.0)

    def _read(self) -> Iterator[tuple[str, ArrayLike]]:
        game = self._game
        yield "time", game.steps / game.max_steps
        for player in game.players:
            for name, array in player.body.state().items():
                yield f"{player.name}.{name}", array
            yield f"{player.name}.present", float(player.name not in game.eliminated)
        for prop in game.world.props.values():  # of a new world after an error of the simulation
            if not prop.fixed or prop.name not in self._built:
                for name, numbers in _of_prop(prop):
                    yield f"{prop.name}.{name}", numbers
        for name, number in game.task.state().items():
            yield f"task.{name}", number


def _of_prop(prop: Prop) -> Iterator[tuple[str, ArrayLike]]:
    yield "position", prop.position
    yield "forward", prop.rotation[:, 0]
    yield "up", prop.rotation[:, 2]
    if not prop.fixed:
        yield "velocity", prop.velocity
        yield "spin", prop.angular_velocity
    yield "colour", prop.colour
    if prop.sound is not None:
        yield "sounding", float(not prop.sound.muted)
