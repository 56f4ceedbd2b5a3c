"""Telling from two ears where in a house a call comes from."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry.pose import Floats, Pose
from veca_marl.sim.physics.playground import RoomCfg
from veca_marl.sim.physics.world import World

# log10 of the root of an ear's energy, as experiments/calling/ears.py measures it (walkers 1.88 and
# 0.37, crawlers 1.91 and 0.40); spreads are wider than measured, since both move
_AT_1_M = 1.88  # both ears' mean, without walls
_ILD = 0.40  # the ears' difference for a call straight from one side
_MEAN_SPREAD, _ILD_SPREAD = 0.15, 0.15
_GRID_M = 0.4
_MEMORY = 0.95  # of what was heard one time before: callers move
_AUDIBLE = -5.0  # a call through three walls has -4, silence -8


class CallMap:
    """How likely somebody calls from each place of a house, by all that was heard.

    A listener knows its own place and the plan of the house. What is heard from places before and
    behind it is the same, until it has turned.

    Args:
        world: Whose house.

    Attributes:
        heard: Whether anything was.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._places = np.concatenate([_grid(room) for room in world.playground.rooms])
        self._loss = world.playground.transmission_loss_db / 20.0
        self._likely = np.zeros(len(self._places))
        self.heard = False

    def hear(self, head: Pose, audio: NDArray[Any]) -> None:
        """Take in what the ears hear now; silence says nothing.

        Args:
            head: The listener's.
            audio: The observation ``(2, 250)``, log10 of magnitudes.
        """
        if audio.max() < _AUDIBLE:
            return
        left, right = loudness(audio)
        self._places[:, 2] = head.position[2]  # as if all mouths were as high as these ears
        way = (self._places - head.position) @ head.rotation
        away_m = np.maximum(np.linalg.norm(way, axis=1), _GRID_M)
        mean = _AT_1_M - np.log10(away_m) - self._loss * self._walls(head.position)
        off = (mean - (left + right) / 2.0) / _MEAN_SPREAD
        aside_off = (_ILD * way[:, 1] / away_m - (left - right)) / _ILD_SPREAD
        self._likely *= _MEMORY
        self._likely -= (off**2 + aside_off**2) / 2.0
        self.heard = True

    def best(self) -> Floats:
        """Return from where ``(3,)`` it was most likely."""
        place: Floats = self._places[int(np.argmax(self._likely))]
        return place

    def _walls(self, ears: Floats) -> NDArray[Any]:
        between = self._world.house.obstacles_between
        return np.array([between(ears, place) for place in self._places])


def _grid(room: RoomCfg) -> Floats:
    """Return places ``(n, 3)`` all over a room's floor."""
    x, y = (
        np.arange(low + _GRID_M / 2.0, low + size, _GRID_M)
        for low, size in zip(room.lower_m[:2], room.size_m[:2], strict=True)
    )
    return np.stack(np.meshgrid(x, y, [0.0]), axis=-1).reshape(-1, 3)


def loudness(audio: NDArray[Any]) -> Floats:
    """Return log10 of the root of each ear's energy, ``(2,)``, from the observation."""
    energy = (10.0 ** (2.0 * audio.astype(np.float64))).sum(axis=1)
    level: Floats = np.log10(energy) / 2.0
    return level
