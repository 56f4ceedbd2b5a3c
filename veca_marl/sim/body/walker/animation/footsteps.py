"""The sound of a walker's steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from veca_marl.sim.geometry import Floats
from veca_marl.sim.physics import World
from veca_marl.sim.sound.modal_synthesis import (
    MATERIALS,
    Material,
    StruckBody,
    acceleration_noise,
    bar_modes,
)

_FOOT_MASS_SHARE = 0.06
"""Effective mass of a foot that lands, as a share of the body's, 6.3 % in walking, 5.3 % in running
(Chi & Schmitt 2005, Mechanical energy and effective foot mass during impact loading)."""

_FLOOR = replace(MATERIALS[Material.wood], loss_tangent=0.1)
"""Boards that lie on joists lose more than free ones; the value is ours."""

_BOARD_M = (0.6, 0.02)  # length and thickness of a floorboard, which the foot excites
_SOLE_M = 0.03  # radius of a sphere with the volume of a child's forefoot


class Footsteps:
    """Strikes a floorboard under a walker whenever one of its feet lands."""

    def __init__(self, name: str, mass_kg: float, world: World) -> None:
        """Add the source of sound of a walker.

        Args:
            name: Of the walker.
            mass_kg: Of the walker.
            world: Its world; nothing is added unless it has sounds of impacts.
        """
        impacts = world.playground.impacts
        self._foot_kg = _FOOT_MASS_SHARE * mass_kg
        self._min_speed_mps = impacts.min_speed_mps
        self._board: StruckBody | None = None
        self._rate_hz, self._last_sample = world.sound.sample_rate_hz, world.sound.step_samples - 1
        if impacts.present:
            sole = MATERIALS[Material.rubber]
            length, thickness = _BOARD_M
            modes = bar_modes(length, thickness / 12.0**0.5, _FLOOR)
            click = acceleration_noise(_SOLE_M, sole.contact_s)
            self._board = StruckBody(modes + click, impacts.gain_per_ns, self._rate_hz)
            self._source = world.sound.add_source(f"{name}.steps", self._board)

    def teleport(self, surface: Floats) -> None:
        """Sound at another place from now on, without motion; see `follow`."""
        if self._board is not None:
            self._source.teleport(_sole(surface))

    def follow(
        self, surface: Floats, landing_speed_mps: float, landings_s: Sequence[float]
    ) -> None:
        """Sound at a place on the floor whenever a foot landed in this agent step.

        Args:
            surface: ``(3,)`` metres, on the floor or prop beneath the walker.
            landing_speed_mps: Speed at which feet land.
            landings_s: When they did, seconds from the beginning of the step.
        """
        if self._board is None:
            return
        self._source.position = _sole(surface)
        if landing_speed_mps > self._min_speed_mps:
            for landing_s in landings_s:
                sample = min(int(landing_s * self._rate_hz), self._last_sample)
                self._board.strike(self._foot_kg * landing_speed_mps, sample)


def _sole(surface: Floats) -> Floats:
    """Return the middle ``(3,)`` of a sole on a surface, metres."""
    place: Floats = surface + np.array([0.0, 0.0, _SOLE_M])
    return place
