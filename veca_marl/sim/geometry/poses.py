"""Rigid poses. Right-handed, Z up; a rotation's columns are forward (x), left (y) and up (z)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Pose(NamedTuple):
    """Position and orientation in the world or on another frame.

    Attributes:
        position: ``(3,)`` metres.
        rotation: ``(3, 3)`` matrix from the local axes to the outer: ``outer = rotation @ local``.
    """

    position: Floats
    rotation: Floats

    @property
    def forward(self) -> Floats:
        """``(3,)`` unit vector: the local x axis, the front of a bone."""
        return np.array(self.rotation[:, 0])

    @property
    def up(self) -> Floats:
        """``(3,)`` unit vector: the local z axis."""
        return np.array(self.rotation[:, 2])
