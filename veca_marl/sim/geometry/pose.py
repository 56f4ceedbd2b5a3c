"""Rigid poses. Right-handed, Z up; a rotation's columns are forward (x), left (y) and up (z)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Pose(NamedTuple):
    """Where something is and how it is turned.

    Attributes:
        position: ``(3,)`` metres, world frame.
        rotation: ``(3, 3)`` matrix from the local frame to the world: ``world = rotation @ local``.
    """

    position: Floats
    rotation: Floats

    @property
    def forward(self) -> Floats:
        """``(3,)`` unit vector in the world frame: the local x axis, the front of a bone."""
        return np.array(self.rotation[:, 0])

    @property
    def up(self) -> Floats:
        """``(3,)`` unit vector in the world frame: the local z axis."""
        return np.array(self.rotation[:, 2])
