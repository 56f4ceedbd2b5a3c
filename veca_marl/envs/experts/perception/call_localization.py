"""Localization of callers in a house from the spectra of two ears."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.physics import RoomCfg, World

# Levels are log10 of the root of an ear's energy, measured by experiments/calling/ears.py (walkers
# 1.88 and 0.37, crawlers 1.91 and 0.40). The standard deviations are larger than measured at rest,
# since callers and listeners move.
_LEVEL_AT_1_M = 1.88  # mean of both ears, without walls
_ILD = 0.40  # interaural level difference of a call from the side
_LEVEL_STD, _ILD_STD = 0.15, 0.15
_GRID_M = 0.4
_MEMORY = 0.95  # decay of the log-likelihood per update, since callers move
_LEAST_ENERGY = 1e-16  # of an ear that hears nothing beside its noise
_AUDIBLE = -5.0  # a call through three walls reaches -4, silence is at -8


class CallSourceMap:
    """Log-likelihood of the position of a caller on a grid over a house.

    A listener knows its own head pose and the walls of the house. One heading leaves open whether
    a call comes from the front or from behind; two headings resolve it.

    Args:
        world: The world, for its rooms and walls.
        noise_power: Squared magnitude of the receivers' own noise in a bin, which is no call, see
            `AudioSense.noise_power`.

    Attributes:
        heard: Whether a call has been heard.
    """

    def __init__(self, world: World, noise_power: float = 0.0) -> None:
        self._world = world
        self._noise_power = noise_power
        self._audible = max(10.0 ** (2.0 * _AUDIBLE), noise_power)
        self._places = np.concatenate([_grid(room) for room in world.playground.rooms])
        self._loss = world.playground.transmission_loss_db / 20.0
        self._log_likelihood = np.zeros(len(self._places))
        self.heard = False

    def update(self, head: Pose, audio: NDArray[Any]) -> None:
        """Update the map with what the ears hear now; silence leaves it unchanged.

        Args:
            head: Pose of the listener's head.
            audio: The observation ``audio``, ``(2, 250)``, log10 of magnitudes.
        """
        power = sound_power(audio, self._noise_power)
        if power.max() < self._audible:
            return
        left, right = loudness(power)
        self._places[:, 2] = head.position[2]  # assumes mouths at the height of these ears
        offsets = (self._places - head.position) @ head.rotation
        distances_m = np.maximum(np.linalg.norm(offsets, axis=1), _GRID_M)
        level = _LEVEL_AT_1_M - np.log10(distances_m) - self._loss * self._walls(head.position)
        level_error = (level - (left + right) / 2.0) / _LEVEL_STD
        ild_error = (_ILD * offsets[:, 1] / distances_m - (left - right)) / _ILD_STD
        self._log_likelihood *= _MEMORY
        self._log_likelihood -= (level_error**2 + ild_error**2) / 2.0
        self.heard = True

    def best(self) -> Floats:
        """Return the most likely position of a caller, ``(3,)`` metres."""
        place: Floats = self._places[int(np.argmax(self._log_likelihood))]
        return place

    def _walls(self, ears: Floats) -> NDArray[Any]:
        """Return the number of walls between the ears and each place, ``(n,)``."""
        between = self._world.house.obstacles_between
        return np.array([between(ears, place) for place in self._places])


def _grid(room: RoomCfg) -> Floats:
    """Return places on a grid over a room's floor, ``(n, 3)`` metres."""
    x, y = (
        np.arange(low + _GRID_M / 2.0, low + size, _GRID_M)
        for low, size in zip(room.lower_m[:2], room.size_m[:2], strict=True)
    )
    return np.stack(np.meshgrid(x, y, [0.0]), axis=-1).reshape(-1, 3)


def sound_power(audio: NDArray[Any], noise_power: float = 0.0) -> Floats:
    """Return the squared magnitudes of what is heard, ``(2, 250)``.

    Args:
        audio: The observation ``audio``, ``(2, 250)``, log10 of magnitudes.
        noise_power: Squared magnitude of the receivers' own noise in a bin.
    """
    power: Floats = np.maximum(10.0 ** (2.0 * audio.astype(np.float64)) - noise_power, 0.0)
    return power


def loudness(power: Floats) -> Floats:
    """Return log10 of the root of each ear's energy, ``(2,)``.

    Args:
        power: Squared magnitudes, ``(2, 250)``, not all 0.
    """
    level: Floats = np.log10(np.maximum(power.sum(axis=1), _LEAST_ENERGY)) / 2.0
    return level
